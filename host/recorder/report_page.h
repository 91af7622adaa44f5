// A session as one HTML page for trainer and trainee: on the screen, and on A4.
#pragma once

#include <string>

#include "host/recorder/session_limits.h"
#include "host/recorder/session_report.h"
#include "host/recorder/session_summary.h"

namespace torquer {

/// What a page shows besides the report.
struct PageParts {
  std::string log;             ///< path of the log, for its name
  SessionLimits limits;        ///< that the scene sets
  bool scene_changed = false;  ///< the scene file is no longer what the session had
  std::string picture;         ///< an <svg> element (DrawReport); "" for none
  EarlierSessions earlier;
};

/// The page, UTF-8, well-formed as XML too. It has all that it shows, needs no script, and no
/// request leaves it. Whatever the log says appears as text: markup is escaped.
std::string FormatPage(const SessionReport& report, const PageParts& parts);

}  // namespace torquer
