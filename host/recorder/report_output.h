// Output of a SessionReport: as text, as JSON, and as a picture.
#pragma once

#include <string>

#include "host/recorder/session_picture.h"
#include "host/recorder/session_report.h"

namespace torquer {

/// Formats lines of text; the last line ends with a newline.
std::string FormatReport(const SessionReport& report);

/// Formats one line with a JSON object. `picture` and `page` are paths of the written files, "" for
/// none.
std::string FormatReportJson(const SessionReport& report, const std::string& picture,
                             const std::string& page);

/// Draws the last state in `vessel` as SVG, with the path of the tip if `tip_way` is set. Throws
/// UserError when that state has fewer than two nodes.
std::string DrawReport(const SessionReport& report, const PictureVessel& vessel, bool tip_way);

}  // namespace torquer
