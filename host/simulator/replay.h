// A recorded session repeated: the same work, not the same time.
#pragma once

#include <functional>
#include <string>

#include "host/simulator/scene/scene.h"
#include "host/support/event_log.h"

namespace torquer::simulator {

struct ReplayResult {
  std::int64_t states = 0;             ///< repeated and compared
  std::int64_t differing = 0;          ///< of these, in their hash or in what else they say
  std::int64_t first_difference = -1;  ///< its tick
  std::int64_t outlines = 0;           ///< of the repeated: in the log without their shape
  std::int64_t missing = 0;            ///< not in the log, repeated from what later ones say
  std::int64_t undecodable = 0;        ///< states and descriptions that are none
  LogDamage damage;                    ///< what of the log could not be read
  bool ended = false;                  ///< the log holds the end of the simulator

  /// All that was recorded was seen, and none of it differs.
  bool Good() const { return differing == 0 && undecodable == 0 && !damage.any(); }
};

/// Repeats the wire states of an LCM log: each with the command and the units of work that it
/// records, and compares their hashes and all else that follows from the commands. States that were
/// not recorded are repeated too, as long as no more than kMostPastInMessage in a row are missing.
/// Of outlines (host/bus/state_outline.h) the hash and all but the shape and contacts are compared.
/// Throws UserError when the log cannot be read, holds no state, has a longer gap, or was recorded
/// with another scene. `go_on`, where there is one, gets what has been found after each record;
/// where it answers false, the rest is left out.
ReplayResult Replay(scene::Scene& scene, const std::string& log,
                    const std::function<bool(const ReplayResult&)>& go_on = {});

}  // namespace torquer::simulator
