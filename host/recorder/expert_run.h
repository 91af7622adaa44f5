// Expert run: a script that reaches a scene's target well, for comparison with a trainee's session.
#pragma once

#include <string>

#include "host/recorder/session_report.h"
#include "host/simulator/scene/scene.h"

namespace torquer {

/// File that holds the expert run of a scene file: experts/NAME.csv beside it.
std::string ExpertPath(const std::string& scene_file);

/// Runs the script at `path` as JudgeSession runs the commands of a session. Throws UserError if it
/// cannot be read.
ExpertRun RunExpert(scene::Scene& scene, const std::string& path);

}  // namespace torquer
