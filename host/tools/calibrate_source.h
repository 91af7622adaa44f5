// Calibration sources: readings and keys from a device and a person, or from a script.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calibration/procedure.h"
#include "host/device/report_decoder.h"
#include "host/device/report_source.h"
#include "host/tools/calibrate_script.h"

namespace torquer::tools {

/// Device properties that must be known before calibration.
struct DeviceFacts {
  std::string serial;
  std::optional<int> sensor_product_id = std::nullopt;  ///< unknown
  int cpi = calibration::kNominalCpi;
  bool ordinary_mouse = false;  ///< its resolution is unknown, and it reports no lift
  bool has_joystick = true;
};

/// Receiver of the data from a source.
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
  /// Waits up to 5 s for the device; throws UserError if it is missing or unusable.
  virtual DeviceFacts Connect() = 0;
  /// Delivers data that arrives within `timeout_ms`; returns early after Interrupt(). Throws
  /// UserError.
  virtual void Wait(int timeout_ms, ReadingSink& sink) = 0;
  virtual void Interrupt() = 0;
};

/// Device, read in the same way as by the daemon.
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

/// Device with a script as its operator: keys are pressed when the hand rests.
class PacedOperator : public ReadingSource {
 public:
  /// Throws UserError if the script moves the device itself.
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
  calibration::Reading rest_{};  // position of the hand since it last moved
  bool any_ = false;
  std::int64_t marked_axial_ = 0, marked_transverse_ = 0;  // position at the last mark
  calibration::Step marked_step_ = calibration::Step::kRest;
  std::int64_t last_reading_us_ = 0;  // time by the host's clock
};

/// Script that moves its own simulated device.
class ScriptedDevice : public ReadingSource {
 public:
  /// Throws UserError if the script names no device.
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
