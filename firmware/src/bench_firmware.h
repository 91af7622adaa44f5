// The firmware as a whole: its start, and its work in every USB frame.
#pragma once

#include <stdint.h>

#include "firmware/src/buttons.h"
#include "firmware/src/joystick.h"
#include "firmware/src/motion_sensor.h"
#include "firmware/src/reference_switch.h"
#include "firmware/src/report.h"
#include "firmware/src/serial_number.h"
#include "firmware/src/settings.h"
#include "firmware/src/usb_stack.h"

namespace torquer {
namespace firmware {

class BenchFirmware final : public ReportHandler {
 public:
  /// `sensor_reports`: the long reports of `sensor`. `second`: the catheter's sensor; null if there
  /// is none. All arguments must outlive this object.
  BenchFirmware(MotionSensor& sensor, SensorReports& sensor_reports, UsbStack& usb,
                MotionSensor* second = nullptr)
      : sensor_(sensor), second_(second), service_(sensor_reports), usb_(usb) {}

  /// Call once, after the board is set up.
  void Start();

  /// Does all pending work and returns. Call after every interrupt. Never waits for the host.
  void Step();

  uint8_t GetInputReport(uint8_t id, uint8_t* report) override;
  uint8_t GetFeatureReport(uint8_t id, uint8_t* report) override;
  bool SetFeatureReport(const uint8_t* report, uint8_t size) override;
  const char* serial() const override { return serial_; }

 private:
  void FollowBus();
  void ServeControl();
  uint8_t ReadContacts() const;
  void Frame();
  void Stream();
  void Doze();
  void RunPendingCommand();
  uint8_t FillIdentity(protocol::IdentityReport& identity) const;
  uint8_t FillDiagnostics(protocol::DiagnosticsReport& diagnostics) const;

  MotionSensor& sensor_;
  MotionSensor* const second_;
  SensorReports& service_;
  UsbStack& usb_;
  Settings settings_;
  Joystick joystick_;
  Buttons buttons_;
  ReferenceSwitch reference_;
  ReportBuilder report_{protocol::kInputReportId};
  ReportBuilder second_report_{protocol::kSecondInputReportId};
  char serial_[kSerialBytes] = {};
  uint32_t command_at_us_ = 0;
  uint32_t frame_start_us_ = 0;
  uint16_t stack_headroom_ = 0;
  uint16_t longest_frame_us_ = 0;
  uint8_t pending_command_ = 0;
  uint8_t waived_frames_ = 0;  // in a row, of the settings and of the sensor's upkeep
  bool suspended_ = false;
  bool second_turn_ = false;  // the two sensors take turns, a frame each
};

}  // namespace firmware
}  // namespace torquer
