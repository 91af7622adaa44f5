// A scene driven by rows of a script: no bus, no clock in the result.
#pragma once

#include <atomic>
#include <cstddef>
#include <string>

#include "host/api/torquer/torquer.h"
#include "host/support/standard_streams.h"

namespace torquer::program {

/// What comes of a script; empty: not wanted.
struct ScriptOutputs {
  /// A state for each row (states_output.h): a file, complete or not there, or kStandardStream.
  std::string states = {};
  std::string pictures = {};  ///< folder, made where missing, of picture_000001.png and so on
  std::string record = {};    ///< file of the session's record (session_record.h), as states
  std::string fields = {};    ///< of the states, with commas between; empty: all
};

/// A run that nobody stops.
inline const std::atomic<bool> kNeverStop = false;

enum class ScriptEnd {
  kStopped,     ///< somebody asked to stop
  kReaderGone,  ///< nobody reads the states on standard output any more
  kLastRow,
};

struct ScriptResult {
  std::size_t rows = 0;  ///< of the script, as far as it came
  std::size_t done = 0;  ///< of these, and written
  int unconverged = 0;   ///< of the done
  ScriptEnd end = ScriptEnd::kStopped;
};

/// Runs the rows of a script (script_columns.h) until `stop`; what is done then is written. The
/// script is a file, all of which is checked before the first row, or kStandardStream, whose rows
/// are done one by one as they come. Throws UserError as ScriptColumns, and naming an output that
/// cannot be written: before the first row, or as soon as the disk fails. Then the states of the
/// rows before are kept (AtomicFile::Finish), and the message says where.
ScriptResult RunScript(const Scene& scene, const std::string& script, const ScriptOutputs& outputs,
                       const std::atomic<bool>& stop = kNeverStop);

}  // namespace torquer::program
