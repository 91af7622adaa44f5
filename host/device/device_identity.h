// Identity of a bench device, which is read before its reports are used.
#pragma once

#include <optional>
#include <string>

#include "host/device/report_source.h"

namespace torquer::device {

/// The remedy for a device whose firmware is not ours, or not of this release.
inline constexpr char kFlashRemedy[] = "install the firmware of this release with: torquer-flash";

struct DeviceIdentity {
  std::string serial;                    ///< printable; of the second sensor: SecondSerial()
  std::optional<int> sensor_product_id;  ///< none if no sensor has answered yet
  bool has_second_sensor = false;
};

/// Identity of the connected device, for the source's sensor. Throws UserError for firmware of
/// another protocol version and for a device without that sensor. Throws FeatureError or DeviceGone
/// if the device does not answer.
DeviceIdentity ReadIdentity(ReportSource& source);

}  // namespace torquer::device
