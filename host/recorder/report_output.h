// A SessionReport for people, for programs, and as a picture.
#pragma once

#include <string>

#include "host/recorder/session_picture.h"
#include "host/recorder/session_report.h"

namespace torquer {

/// Some lines of text, the last one ended.
std::string FormatReport(const SessionReport& report);

/// One line: a JSON object. `picture` is the path of the picture, "" for none.
std::string FormatReportJson(const SessionReport& report, const std::string& picture);

/// The picture of the last state in `vessel`, as SVG.
/// Throws UserError when that state has fewer than two nodes.
std::string DrawReport(const SessionReport& report, const PictureVessel& vessel);

}  // namespace torquer
