// Driver of the PixArt PMW3360 and PMW3389: start-up, motion, and checks for a spontaneous reset of
// the sensor. The two types differ in id and in the register of the resolution.
#pragma once

#include "firmware/src/motion_sensor.h"
#include "firmware/src/pmw3360_bus.h"
#include "protocol/hid_reports.h"

namespace torquer {
namespace firmware {

class Pmw3360 final : public MotionSensor {
 public:
  /// `sensor` is that of board::SelectSensor().
  explicit Pmw3360(uint8_t sensor = 0) : bus_(sensor) {}

  void Start(uint16_t cpi) override;
  void BeginRead() override;
  MotionSample Read() override;
  void Maintain() override;
  void Sleep() override;
  void Wake() override;
  void SetCpi(uint16_t cpi) override { wanted_cpi_ = cpi; }
  uint16_t cpi() const override { return cpi_; }
  uint8_t product_id() const override { return product_id_; }
  uint8_t revision() const override { return revision_; }
  uint16_t restarts() const override { return restarts_; }
  bool running() const override { return state_ == State::kRunning && bad_readings_ == 0; }
  uint16_t self_resets() const override { return self_resets_; }
  protocol::SensorFaultCause fault_cause() const override { return fault_cause_; }
  uint8_t observation() const override { return observation_; }
  uint8_t srom_id() const override { return srom_id_; }
  bool srom_lost() const override { return srom_lost_; }

  /// --- for SensorService ---------------------------------------------------------------------
  /// Starts the sensor again, up to the point at which it waits for a firmware image.
  void RequestSrom();
  bool AwaitsSrom() const { return state_ == State::kAwaitSrom; }
  /// Call when the image has been sent. running() and srom_id() then show if the sensor has
  /// accepted it.
  void SromSent();
  /// Call if the image will not come, or not completely. The sensor starts without it.
  void AbandonSrom();
  /// Takes a picture, once the sensor has run long enough; false if it does not run.
  bool RequestPicture();
  bool picture_wanted() const { return picture_wanted_; }
  bool PictureReady() const { return state_ == State::kPictureReady; }
  /// Ends the picture: the sensor starts again.
  void EndPicture();
  /// True once the start after an image or a picture is over, whether it succeeded or failed.
  bool Settled() const { return state_ == State::kRunning || state_ == State::kWaitToReset; }
  Pmw3360Bus& bus() { return bus_; }

 private:
  enum class State : uint8_t {
    kWaitToReset,  // power-up time, or the pause before the next attempt
    kSettle,       // after the reset command
    kClearMotion,  // reads the motion registers once, as the reset procedure requires
    kIdentify,
    kPrepareSrom,
    kEnableSrom,
    kStartSrom,
    kAwaitSrom,
    kCheckSrom,
    kConfigure,  // rest modes off, resolution
    kClearObservation,
    kObserve,
    kVerify,
    kDiscardMotion,  // discards counts from before the resolution was set
    kRunning,
    kBeginPicture,
    kAskPicture,
    kTakePicture,
    kExposePicture,
    kPictureReady,
    kShutDown,  // sends the sensor to sleep
    kAsleep,
  };

  bool Passes(uint8_t check);
  void WriteResolution();
  uint8_t ResolutionRegister() const;
  uint8_t ResolutionValue() const;
  void ArmBurst();
  void WaitThen(State next, uint32_t us);
  void ForgetSrom();
  void Restart();
  void Fail(protocol::SensorFaultCause cause);
  void Observe();
  void CheckHealth();

  Pmw3360Bus bus_;
  uint32_t resume_at_us_ = 0;  // time of the next step of the state machine
  uint32_t reset_at_us_ = 0;
  uint16_t wanted_cpi_ = 0;
  uint16_t cpi_ = 0;
  uint16_t restarts_ = 0;
  uint16_t self_resets_ = 0;
  uint16_t backoff_ms_ = 0;
  int16_t withheld_x_ = 0;  // held back, from a doubtful reading
  int16_t withheld_y_ = 0;
  State state_ = State::kWaitToReset;
  protocol::SensorFaultCause fault_cause_ = protocol::kSensorNoFault;
  uint8_t step_ = 0;
  uint8_t bad_readings_ = 0;
  uint8_t frames_to_check_ = 0;
  uint8_t next_check_ = 0;
  uint8_t check_ = 0;              // the current one
  uint8_t observation_ = 0;        // value that every burst must show
  uint8_t blind_starts_ = 0;       // consecutive starts without frames
  uint8_t frames_to_observe_ = 0;  // frames left until its bits must be back; 0: they are back
  uint8_t product_id_ = 0;
  uint8_t revision_ = 0;
  uint8_t srom_id_ = 0;
  bool in_doubt_ = false;  // the latest reading was, and Maintain() is to make sure
  bool srom_wanted_ = false;
  bool srom_lost_ = false;
  bool shut_down_ = false;  // by this driver, and not started since
  bool picture_wanted_ = false;
};

}  // namespace firmware
}  // namespace torquer
