// Replays a recorded session: repeats the same work, but not at the same times.
#pragma once

#include <functional>
#include <string>

#include "host/simulator/scene/scene.h"
#include "host/support/event_log.h"

namespace torquer::simulator {

struct ReplayResult {
  std::int64_t states = 0;             ///< repeated and compared
  std::int64_t differing = 0;          ///< states whose hash or other fields differ
  std::int64_t first_difference = -1;  ///< tick of the first differing state; -1: none
  std::int64_t outlines = 0;           ///< repeated states that are in the log without their shape
  std::int64_t missing = 0;            ///< states that are not in the log, repeated from later ones
  std::int64_t undecodable = 0;        ///< messages that cannot be decoded
  LogDamage damage;                    ///< parts of the log that cannot be read
  bool ended = false;                  ///< the log contains the simulator's end

  /// True if all records were read and no state differs.
  bool Good() const { return differing == 0 && undecodable == 0 && !damage.any(); }
};

/// Repeats the wire states of an LCM log, each with its recorded command and units of work.
/// Compares their hashes and all other fields that follow from the commands. Missing states are
/// repeated too, if at most kMostPastInMessage in a row are missing. The shape and contacts of
/// outlines (host/bus/state_outline.h) are not compared. Throws UserError if the log cannot be
/// read, has no state, has a longer gap, or is from another scene. `go_on`, if set, gets the result
/// so far after each record, and stops the replay by false.
ReplayResult Replay(scene::Scene& scene, const std::string& log,
                    const std::function<bool(const ReplayResult&)>& go_on = {});

}  // namespace torquer::simulator
