// A scene driven by a file: no bus, no clock in the result.
#pragma once

#include <string>
#include <vector>

#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// What comes of a script; empty: not wanted.
struct ScriptOutputs {
  std::string states = {};    ///< file of one JSON object a row, complete or not there
  std::string pictures = {};  ///< folder, made where missing, of picture_000001.png and so on
  std::string record = {};    ///< file of the session's record (session_record.h), as states
};

/// The rows of a script: CSV with a column time_s, ascending, and any of NAME.insertion_mm and
/// NAME.rotation_rad of each instrument, absolute since the start, lao_deg, cra_deg, xray and
/// contrast (0 or 1). Throws UserError naming file, line, value and remedy.
std::vector<Command> ReadScript(const std::string& script, const scene::Scene& scene);

/// Runs the rows of a script. Returns the number of rows that did not converge. Throws UserError
/// as ReadScript, and naming an output that cannot be written.
int RunScript(scene::Scene& scene, const std::string& script, const ScriptOutputs& outputs);

}  // namespace torquer::simulator
