// Runs a scene by the rows of a script, without a bus. The motion does not depend on a clock.
#pragma once

#include <atomic>
#include <cstddef>
#include <string>

#include "host/api/torquer/torquer.h"
#include "host/support/standard_streams.h"

namespace torquer::program {

/// Paths of the outputs of a script; empty: not wanted.
struct ScriptOutputs {
  /// States, one for each row (states_output.h): kStandardStream, or a file, complete or absent.
  std::string states = {};
  std::string pictures = {};  ///< folder of picture_000001.png and so on; made if missing
  std::string record = {};  ///< file of the session's record (session_record.h), complete or absent
  std::string fields = {};  ///< names of state fields with commas between; empty: all
};

/// Stop flag of a run that never stops early.
inline const std::atomic<bool> kNeverStop = false;

enum class ScriptEnd {
  kStopped,     ///< stop was requested
  kReaderGone,  ///< the reader of standard output has gone
  kLastRow,
};

struct ScriptResult {
  std::size_t rows = 0;  ///< rows of the file, or rows read from standard input
  std::size_t done = 0;  ///< rows completed and written
  int unconverged = 0;   ///< rows that ended before equilibrium
  ScriptEnd end = ScriptEnd::kStopped;
};

/// Runs the rows of a script (script_columns.h) until `stop`; the output has all completed rows.
/// The script is a file, checked completely before the first row. Or it is kStandardStream, whose
/// rows run as they arrive. Throws UserError as ScriptColumns does. Throws it naming an output that
/// cannot be written: before the first row, or when the disk fails. After a disk failure the states
/// of earlier rows are kept (AtomicFile::Finish), and the message gives their path.
ScriptResult RunScript(const Scene& scene, const std::string& script, const ScriptOutputs& outputs,
                       const std::atomic<bool>& stop = kNeverStop);

}  // namespace torquer::program
