// A SessionReport for people, for programs, and as a picture.
#pragma once

#include <string>

#include "host/recorder/session_picture.h"
#include "host/recorder/session_report.h"

namespace torquer {

/// Some lines of text, the last one ended.
std::string FormatReport(const SessionReport& report);

/// One line: a JSON object. `picture` and `page` are the paths of what was written, "" for none.
std::string FormatReportJson(const SessionReport& report, const std::string& picture,
                             const std::string& page);

/// The picture of the last state in `vessel`, as SVG, with the way of the tip where it is wanted.
/// Throws UserError when that state has fewer than two nodes.
std::string DrawReport(const SessionReport& report, const PictureVessel& vessel, bool tip_way);

}  // namespace torquer
