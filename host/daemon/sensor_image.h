// Firmware image of the sensor's manufacturer: loaded again whenever the device's sensor has lost
// it.
//
// The sensor loses the image without power: at plug-in and after a suspend. It also loses the image
// when it or the device resets itself. `torquer-flash --srom` stores a copy for a device; without a
// stored copy, no image is loaded.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host/device/report_source.h"

namespace torquer::daemon {

class SensorImage {
 public:
  /// The device with this serial number was connected, for the first time or again.
  void OnConnected(const std::string& serial);
  /// The device has restarted: its sensor has lost the image, and the device does not know that one
  /// was loaded.
  void OnReset();
  /// The flags (protocol::ReportFlag) of each report.
  void OnReport(std::uint8_t flags);

  /// True if Load() should be called now: tries are left and the sensor works.
  bool due() const { return tries_left_ > 0 && working_; }
  /// Loads the stored image, in some 0.3 s. Returns the outcome as a sentence for the user. Returns
  /// nullopt if no image is due, or if the outcome is the same as before. A device that refuses or
  /// does not answer gets at most three tries per loss. Throws device::DeviceGone.
  std::optional<std::string> Load(device::ReportSource& source);

  /// Number of times an image was loaded.
  std::int64_t loaded() const { return loaded_; }

 private:
  static constexpr int kTries = 3;

  std::optional<std::string> Try(device::ReportSource& source);

  std::string serial_;
  bool lost_ = false;  // the device reports the image as lost
  int tries_left_ = 0;
  bool working_ = false;
  std::optional<std::string> reported_;  // outcome of the tries since the last loss
  std::int64_t loaded_ = 0;
};

}  // namespace torquer::daemon
