// Judge of a session: repeats its commands at full accuracy. So the machine's load does not change
// the marks.
#pragma once

#include <string>
#include <torquer_lcm/readings_t.hpp>

#include "host/recorder/session_course.h"
#include "host/recorder/session_report.h"
#include "host/simulator/scene/scene.h"

namespace torquer {

/// Result of a replay of a session's commands.
struct SessionJudgment {
  std::string not_gradable;            ///< reason; "": the replay holds all that decides the marks
  torquer_lcm::readings_t readings{};  ///< at the end; no names if the session was not repeated
  SessionCourse course;                ///< of the replay

  /// True if the session was repeated.
  bool repeated() const { return !readings.names.empty(); }
};

/// Repeats the commands of the log at `path` as rows of a script. There is no deadline; a tick has
/// the scene's budget for scripts. A row ends every kJudgeRowUs by the clock of the log. A log that
/// does not hold all that decides the marks is not gradable. A scene without observers has no
/// measures and is not repeated. Throws UserError if the log cannot be read.
SessionJudgment JudgeSession(scene::Scene& scene, const std::string& path);

/// Interval between the ends of two rows, us. The hands move linearly within it.
inline constexpr std::int64_t kJudgeRowUs = 5000;

/// Replaces the measures of the live session in `report` by those of the judgment.
void ApplyJudgment(const SessionJudgment& judgment, SessionReport& report);

}  // namespace torquer
