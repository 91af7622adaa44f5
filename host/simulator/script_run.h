// A scene driven by a file: no bus, no clock in the result.
#pragma once

#include <string>

#include "host/simulator/scene/scene.h"

namespace torquer::simulator {

/// What comes of a script; empty: not wanted.
struct ScriptOutputs {
  std::string states = {};    ///< file of one JSON object a row, complete or not there
  std::string pictures = {};  ///< folder, made where missing, of picture_000001.png and so on
  std::string record = {};    ///< file of the session's record (session_record.h), as states
};

/// Runs the rows of `script`: CSV with the header time_s,insertion_mm,rotation_rad, absolute since
/// the start, ascending times; if need be with lao_deg,cra_deg,xray,contrast, of which the last two
/// are 0 or 1, and then, where the scene has a catheter, catheter_insertion_mm,
/// catheter_rotation_rad. Returns the number of rows that did not converge.
/// Throws UserError naming file, line, value and remedy.
int RunScript(scene::Scene& scene, const std::string& script, const ScriptOutputs& outputs);

}  // namespace torquer::simulator
