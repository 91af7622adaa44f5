// Driver of the PixArt PMW3360 over the board's SPI: timing, start-up, health.
#pragma once

#include "firmware/src/motion_sensor.h"

namespace torquer {
namespace firmware {

class Pmw3360 final : public MotionSensor {
 public:
  /// To be called once, at power-up. The calls of Maintain() that follow start the sensor; until it
  /// runs, Read() reports a fault.
  void Start(uint16_t cpi);

  MotionSample Read() override;
  void Maintain() override;
  void Sleep() override;
  void Wake() override;
  void SetCpi(uint16_t cpi) override { wanted_cpi_ = cpi; }
  uint16_t cpi() const override { return cpi_; }
  uint8_t product_id() const override { return product_id_; }
  uint8_t revision() const override { return revision_; }
  uint8_t srom_id() const override { return srom_id_; }
  uint16_t restarts() const override { return restarts_; }
  bool running() const override { return state_ == State::kRunning && bad_readings_ == 0; }

 private:
  enum class State : uint8_t {
    kWaitToReset,  // power-up time, or the pause before the next attempt
    kSettle,       // after the reset command
    kClearMotion,  // reading the motion registers once, as the reset procedure demands
    kIdentify,
    kPrepareSrom,
    kEnableSrom,
    kStartSrom,
    kLoadSrom,
    kCheckSrom,
    kSetCpi,
    kRunning,
    kShutDown,  // to be sent to sleep
    kAsleep,
  };

  void WaitUntilReady();
  uint8_t ReadRegister(uint8_t address);
  void WriteRegister(uint8_t address, uint8_t value);
  void ApplyCpi();
  void ArmBurst();
  void WaitThen(State next, uint32_t us);
  void Fail();
  void LoadSromBytes();
  void CheckHealth();

  uint32_t ready_at_us_ = 0;   // earliest next access, from the timing of the last one
  uint32_t resume_at_us_ = 0;  // when the state machine goes on
  uint16_t wanted_cpi_ = 0;
  uint16_t cpi_ = 0;
  uint16_t restarts_ = 0;
  uint16_t backoff_ms_ = 0;
  uint16_t srom_sent_ = 0;
  State state_ = State::kWaitToReset;
  uint8_t step_ = 0;
  uint8_t bad_readings_ = 0;
  uint8_t frames_to_check_ = 0;
  uint8_t product_id_ = 0;
  uint8_t revision_ = 0;
  uint8_t srom_id_ = 0;
  bool shut_down_ = false;  // by this driver, and not started since
};

}  // namespace firmware
}  // namespace torquer
