// Record of a session, as one JSON object in a file.
#pragma once

#include <string>

#include "host/simulator/simulation.h"
#include "host/support/atomic_file.h"

namespace torquer::simulator {

/// Version of the record's format; changes with the meaning or the name of a field.
inline constexpr int kRecordVersion = 3;

/// Record of the simulated scene, its last state, and every reading of the scene's observers.
/// [effects.assessment] adds the trainee's measures. Fields: host/simulator/effects/README.md.
class SessionRecord {
 public:
  /// Call it before the session. Opens `path` for writing and reserves disk space, so that the
  /// record of a long session is not lost. `observed`: true if `scene`, a file, has an observer.
  /// Throws UserError if `path` cannot be written, or if the scene has no observer.
  SessionRecord(const std::string& path, const std::string& scene, bool observed);

  /// Writes the complete record. Throws UserError on failure.
  void Finish(const std::string& record);

 private:
  AtomicFile file_;
};

/// Text of a record, with its line end. `examination`: the session was one, not practice.
std::string FormatRecord(const Simulation& simulation, bool examination);

}  // namespace torquer::simulator
