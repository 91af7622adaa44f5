// HTML page of a session for trainer and trainee, on the screen and on A4.
#pragma once

#include <string>

#include "host/recorder/session_limits.h"
#include "host/recorder/session_report.h"
#include "host/recorder/session_summary.h"

namespace torquer {

/// Contents of a page besides the report.
struct PageParts {
  std::string log;             ///< path of the log, for its name
  SessionLimits limits;        ///< limits from the scene
  bool scene_changed = false;  ///< the scene file has changed since the session
  std::string picture;         ///< an <svg> element (DrawReport); "" for none
  EarlierSessions earlier;
};

/// Formats the page in UTF-8, also well-formed as XML. It is self-contained: no script and no
/// network request. Text from the log is escaped, so markup in it has no effect.
std::string FormatPage(const SessionReport& report, const PageParts& parts);

}  // namespace torquer
