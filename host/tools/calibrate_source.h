// Where the readings and keys of a calibration come from: a device and a person, or a script.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "calibration/procedure.h"
#include "host/device/report_decoder.h"
#include "host/device/report_source.h"
#include "host/tools/calibrate_script.h"

namespace torquer::tools {

/// What must be known of a device before it is calibrated.
struct DeviceFacts {
  std::string serial;
  int cpi = calibration::kNominalCpi;
  bool ordinary_mouse = false;  ///< its resolution is unknown, and it reports no lift
  bool has_joystick = true;
};

/// Gets what a source delivers.
class ReadingSink {
 public:
  virtual ~ReadingSink() = default;
  virtual void Take(const calibration::Reading& reading) = 0;
  virtual void Press(calibration::Key key) = 0;
  virtual void Quit() = 0;
  virtual void Inform(const std::string& text) = 0;  ///< a line for the operator
  virtual calibration::Step step() const = 0;
};

class ReadingSource {
 public:
  virtual ~ReadingSource() = default;
  /// Waits for the device, for 5 s; throws UserError when there is none or it cannot be used.
  virtual DeviceFacts Connect() = 0;
  /// Delivers what arrives within `timeout_ms`; returns early after Interrupt(). Throws UserError.
  virtual void Wait(int timeout_ms, ReadingSink& sink) = 0;
  virtual void Interrupt() = 0;
};

/// A device, read as the daemon reads it.
class DeviceReadings : public ReadingSource {
 public:
  DeviceReadings(std::unique_ptr<device::ReportSource> source, bool ordinary_mouse,
                 bool has_joystick);
  DeviceFacts Connect() override;
  void Wait(int timeout_ms, ReadingSink& sink) override;
  void Interrupt() override { source_->Interrupt(); }

 private:
  void CheckIdentity(const std::string& place);

  std::unique_ptr<device::ReportSource> source_;
  device::ReportDecoder decoder_;
  DeviceFacts facts_;
  std::vector<calibration::Reading> early_;  // arrived during Connect()
};

/// A device with a script as its operator: keys are pressed when the hand rests.
class PacedOperator : public ReadingSource {
 public:
  /// Throws UserError when the script moves the device itself.
  PacedOperator(std::unique_ptr<ReadingSource> device, Script script);
  DeviceFacts Connect() override { return device_->Connect(); }
  void Wait(int timeout_ms, ReadingSink& sink) override;
  void Interrupt() override { device_->Interrupt(); }

 private:
  class Watcher;
  void Follow(const calibration::Reading& reading, ReadingSink& sink);

  std::unique_ptr<ReadingSource> device_;
  Script script_;
  std::size_t next_ = 0;
  calibration::Reading rest_{};  // the place of the hand since it last moved
  bool any_ = false;
  std::int64_t marked_axial_ = 0, marked_transverse_ = 0;  // at the last mark
  calibration::Step marked_step_ = calibration::Step::kRest;
  std::int64_t last_reading_us_ = 0;  // by the host's clock
};

/// A script that moves its own device.
class ScriptedDevice : public ReadingSource {
 public:
  /// Throws UserError when the script names no device.
  explicit ScriptedDevice(Script script);
  DeviceFacts Connect() override;
  void Wait(int timeout_ms, ReadingSink& sink) override;
  void Interrupt() override {}

 private:
  void Play(const Statement& statement, ReadingSink& sink);

  Script script_;
  std::size_t next_ = 0;
  calibration::Reading reading_{};
  double axial_ = 0.0, transverse_ = 0.0;
};

}  // namespace torquer::tools
