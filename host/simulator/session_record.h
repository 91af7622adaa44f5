// How a session went, as one JSON object in a file.
#pragma once

#include <string>

#include "host/simulator/simulation.h"
#include "host/support/atomic_file.h"

namespace torquer::simulator {

/// Version of the record's format: another meaning or another name of a field makes a new one.
inline constexpr int kRecordVersion = 2;

/// The record: what was simulated, how far it went, and every reading of the scene's observers, of
/// which [effects.assessment] has the trainee's measures. Fields: host/simulator/effects/README.md.
class SessionRecord {
 public:
  /// Before the session runs: `path` is opened for writing, and room for it set aside, so that an
  /// hour is not lost. `observed`: whether `scene`, a file, has an observer.
  /// Throws UserError when it cannot be, or when the scene has no observer to record.
  SessionRecord(const std::string& path, const std::string& scene, bool observed);

  /// Writes the record, which is whole then. Throws UserError when that fails.
  void Finish(const std::string& record);

 private:
  AtomicFile file_;
};

/// A record as text, with its line end.
std::string FormatRecord(const Simulation& simulation);

}  // namespace torquer::simulator
