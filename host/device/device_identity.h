// Who a bench device is, asked before anything that it reports is believed.
#pragma once

#include <string>

#include "host/device/report_source.h"

namespace torquer::device {

/// What mends a device whose firmware is not ours, or not of this release.
inline constexpr char kFlashRemedy[] = "install the firmware of this release with: torquer-flash";

/// The serial number of the device at hand, printable. Throws UserError for firmware of another
/// protocol version; FeatureError, DeviceGone where it does not answer.
std::string ReadSerial(ReportSource& source);

}  // namespace torquer::device
