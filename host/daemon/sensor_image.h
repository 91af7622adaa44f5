// The sensor maker's firmware image: loaded again whenever the device's sensor has lost it.
//
// The sensor forgets the image without power: when the device is plugged in, after a suspend, and
// when the sensor or the device resets itself. Whoever wants the image has it kept by torquer-flash
// --srom; nothing is done for a device for which none is kept.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host/device/report_source.h"

namespace torquer::daemon {

class SensorImage {
 public:
  /// The device with this serial number is here, or here again.
  void OnConnected(const std::string& serial);
  /// It has restarted: its sensor has lost the image, and it does not know that there was one.
  void OnReset() { tries_left_ = kTries; }
  /// The flags (protocol::ReportFlag) of each report.
  void OnReport(std::uint8_t flags);

  /// There is something for Load() to do now: the sensor works.
  bool due() const { return tries_left_ > 0 && working_; }
  /// Loads the image that is kept, some 0.3 s; what happened, as a sentence for the user, or
  /// nothing where there was nothing to do. A device that refuses or does not answer is asked three
  /// times in all before the next loss. Throws device::DeviceGone.
  std::optional<std::string> Load(device::ReportSource& source);

  /// Times that an image was loaded.
  std::int64_t loaded() const { return loaded_; }

 private:
  static constexpr int kTries = 3;

  std::string serial_;
  bool lost_ = false;  // the device says so
  int tries_left_ = 0;
  bool working_ = false;
  std::int64_t loaded_ = 0;
};

}  // namespace torquer::daemon
