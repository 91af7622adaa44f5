// What torquer-calibrate --focus shows: the sensor's picture, live, with a verdict on how the
// sensor sits over the cylinder.
#pragma once

#include <atomic>
#include <string>

#include "host/device/report_source.h"

namespace torquer::tools {

/// On a terminal pictures follow each other until q, or until `stop` is set; elsewhere a few are
/// taken. The last one is written as PNG to `png_path`, unless that is "". Returns whether the
/// verdict is good. Throws UserError when there is no device or no picture.
bool ShowFocus(device::ReportSource& source, const std::string& png_path,
               const std::atomic<bool>& stop);

}  // namespace torquer::tools
