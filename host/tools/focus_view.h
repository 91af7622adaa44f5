// Focus view (torquer-calibrate --focus): the live sensor picture, with a verdict on the sensor's
// position over the cylinder.
#pragma once

#include <atomic>
#include <string>

#include "host/device/report_source.h"

namespace torquer::tools {

/// Shows pictures on a terminal until q is pressed or `stop` is set; without a terminal a few are
/// taken. The last picture is written as PNG to `png_path`, unless that is "". Returns true if the
/// verdict is good. Throws UserError if there is no device or no picture.
bool ShowFocus(device::ReportSource& source, const std::string& png_path,
               const std::atomic<bool>& stop);

}  // namespace torquer::tools
