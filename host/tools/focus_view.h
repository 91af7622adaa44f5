// Focus view (torquer-calibrate --focus): the live sensor picture, with a verdict on the sensor's
// position over the cylinder.
#pragma once

#include <atomic>
#include <optional>
#include <string>

#include "host/device/report_source.h"

namespace torquer::tools {

/// Pictures at several heights of the sensor, kept from run to run.
struct FocusSeries {
  std::string path;     ///< CSV file with the columns shims_mm and sharpness; may not exist yet
  double shims_mm = 0;  ///< height of the shims now, >= 0
};

/// Shows pictures on a terminal until q is pressed or `stop` is set; without a terminal a few are
/// taken. The last picture is written as PNG to `png_path`, unless that is "". With `series`, the
/// sharpness is added to its file, and the focus is sought among all heights there. Returns true if
/// the verdict is good and, with `series`, the surface in focus. Throws UserError without a device
/// or picture, or if the file is not a series.
bool ShowFocus(device::ReportSource& source, const std::string& png_path,
               const std::optional<FocusSeries>& series, const std::atomic<bool>& stop);

}  // namespace torquer::tools
