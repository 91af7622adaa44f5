// Scene run: random hands in a scene, and the conditions that must hold after every tick.
#pragma once

#include <random>
#include <string>

#include "host/simulator/scene/scene.h"

namespace torquer::study {

/// Results of a scene run.
struct SceneOutcome {
  std::string broken;  ///< violated condition and its tick; empty if none
  int ticks = 0;
  int converged = 0;
  int snaps = 0;
  /// Converged ticks in which the radius of a bend of a lumen is less than its diameter. Their
  /// contacts are not checked.
  int sharp_bends = 0;
  double deepest_mm = 0;  ///< deepest penetration of the wall in all ticks
  double overlap_mm = 0;  ///< deepest penetration of a lumen's wall at rest
  double closest = 1;     ///< smallest distance of instruments beside each other at rest, in parts
                          ///< as a fraction of the distance at which they touch
  double worst_rise = 0;  ///< relative rise of the energy over one step at rest
  bool settled = false;   ///< converged at the end, with the hands still
  double last_residual = 0;
};

/// Moves the hands of a scene at random for `moves` moves of some ticks each. Then it holds them
/// still, draws all instruments out, and begins again.
///
/// After every tick it checks the geometry of every curve and the account of each hand. Energies,
/// forces and readings must be finite. At rest no instruments overlap without the energy of a
/// contact, and steps must not raise the energy. In a scene that does not evolve by itself, the
/// instruments must come to rest. A copy of the run, and a second start, must repeat the states bit
/// for bit.
SceneOutcome RunScene(scene::Scene& scene, std::mt19937& random, int moves);

}  // namespace torquer::study
