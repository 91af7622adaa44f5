// Memory of Newton's method: all that one tick passes on to the next.
#pragma once

#include <cstdint>
#include <vector>

#include "host/simulator/core/newton/active_set.h"
#include "host/simulator/core/newton/damping.h"
#include "host/simulator/core/newton/feed_prediction.h"
#include "host/simulator/core/newton/travel_prediction.h"
#include "host/simulator/core/wire_mechanics.h"

namespace torquer {

/// A value type: a copy continues like the original, in the same scene.
struct NewtonMemory {
  /// Progress of the relaxation.
  enum class Phase : std::uint8_t {
    kIdle,        ///< between iterations
    kAttempting,  ///< an iteration has begun, and none of its attempts was accepted
    kStalled,     ///< no step improves the wire
  };
  /// Progress of a part of the motion, from EnergyTerm::Begin to EnergyTerm::End.
  enum class Part : std::uint8_t {
    kClosed,
    kOpen,
    kMoved,  ///< open, and the wire was moved in it
  };

  Phase phase = Phase::kIdle;
  Part part = Part::kClosed;
  bool moved = false;   ///< the wire was moved, and no step accepted since
  bool pushed = false;  ///< pushed off an unstable equilibrium, in this part
  bool stable = false;  ///< the Hessian was positive definite at the state, or one step before
  bool paired = true;   ///< the pairs of the curves (CurvePairs) are those of the state
  int pairings = 0;     ///< since the move
  double residual_when_paired = 0;  ///< residual of the state whose pairs the curves have
  /// Sum of the longest moves of a node since then, mm; only for curves beside each other.
  double moved_since_paired_mm = 0;
  int iterations_since_move = 0;
  std::vector<ActiveSet> active_sets{};  ///< of the wall; by curve
  Damping damping{};
  std::vector<FeedPrediction> feeds{};      ///< by curve
  std::vector<TravelPrediction> travels{};  ///< by curve
  double travel_mm = 0;                     ///< travel of the vessel at `current`
  bool up_to_date = true;                   ///< `current` belongs to the state
  QuadraticModel
      current;  ///< quadratic model at the state; while attempting with the loads of the model

  bool attempting() const { return phase == Phase::kAttempting; }
  bool stalled() const { return phase == Phase::kStalled; }

  /// Makes the data of each curve.
  void Reserve(const WireMechanics& mechanics);
  /// Forgets the motion and the iterations, but keeps `current`.
  void Forget();
  /// Forgets the motions that the next feed of each curve and the vessel's next motion continue.
  void ForgetPredictions() {
    for (FeedPrediction& prediction : feeds) prediction.Forget();
    ForgetTravels();
  }
  /// Forgets the motion that the vessel's next motion continues.
  void ForgetTravels() {
    for (TravelPrediction& prediction : travels) prediction.Forget();
  }
  /// Call it after each move.
  void Move();
  /// Mixes the memory into a hash of the state. Two memories with the same hash continue alike.
  std::uint64_t Hash(std::uint64_t seed) const;
};

}  // namespace torquer
