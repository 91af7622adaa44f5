// A scene driven by a file: no bus, no clock in the result.
#pragma once

#include <atomic>
#include <cstddef>
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

/// A run that nobody stops.
inline const std::atomic<bool> kNeverStop = false;

struct ScriptResult {
  std::size_t rows = 0;  ///< of the script
  std::size_t done = 0;  ///< of these, and written
  int unconverged = 0;   ///< of the done
};

/// Runs the rows of a script until `stop`; what is done then is written. Throws UserError as
/// ReadScript, and naming an output that cannot be written: before the first row, or as soon as the
/// disk fails. Then the states of the rows before are kept (AtomicFile::Finish), and the message
/// says where.
ScriptResult RunScript(scene::Scene& scene, const std::string& script, const ScriptOutputs& outputs,
                       const std::atomic<bool>& stop = kNeverStop);

}  // namespace torquer::simulator
