// A scene driven by a file: no bus, no clock in the result.
#pragma once

#include <string>

#include "host/simulator/scene/scene.h"

namespace torquer::simulator {

/// Runs the rows of `script` (CSV, header time_s,insertion_mm,rotation_rad; absolute since the
/// start, ascending times) and writes one JSON object a row to `states` (written to a temporary
/// file first: complete or not there). Returns the number of rows that did not converge.
/// Throws UserError naming file, line, value and remedy.
int RunScript(scene::Scene& scene, const std::string& script, const std::string& states);

}  // namespace torquer::simulator
