// Damping weight of the steps of Newton's method.
#pragma once

#include <algorithm>
#include <cstdint>

#include "host/simulator/core/hash.h"

namespace torquer {

/// Damping weight of a step, mu. Every diagonal of the Hessian gets mu times the local EI/(1 mm),
/// for spins GJ (README, section 7). A weight of 0 gives Newton's step; a large weight gives a
/// short step down the gradient. The weight is proportional to the residual, which keeps the
/// quadratic convergence. The ratio that worked is remembered from tick to tick.
class Damping {
 public:
  /// Weight of the next attempt.
  double weight() const { return weight_; }

  /// Call it before the first attempt of an iteration.
  void Begin(double residual) {
    // Far from equilibrium, a first step without damping would leave the region in which its model
    // holds.
    const double ratio = residual > kFarResidual ? std::max(ratio_, kFarRatio) : ratio_;
    weight_ = ratio * residual;
    if (weight_ < kSmallestWeight) weight_ = 0;
    refused_ = false;
  }
  /// Call it after a refused attempt. Returns false if a larger weight makes no sense, because the
  /// step would be shorter than rounding.
  bool Raise(double residual) {
    refused_ = true;
    weight_ = std::max({10 * weight_, kFirstRatio * residual, kSmallestWeight});
    return weight_ <= kLargestWeight;
  }
  /// Call it after an accepted step. `well`: the step was not shortened, and its gain was near the
  /// prediction.
  void Accept(double residual, bool well, bool after_move) {
    if (refused_) {
      ratio_ = weight_ / residual;
    } else if (weight_ > 0 && well) {
      ratio_ /= 1.5;  // the weight sufficed at once, so try a smaller one next time
    }
    if (after_move) ratio_after_move_ = ratio_;
  }
  /// Call it after a move: restores the ratio that worked after the last move.
  void Move() { ratio_ = ratio_after_move_; }
  /// Resets to the initial state.
  void Forget() { ratio_ = ratio_after_move_ = 0; }
  /// Forgets the ratio for the next move.
  void ForgetMoves() { ratio_after_move_ = 0; }

  std::uint64_t Hash(std::uint64_t seed) const {
    return HashDouble(ratio_, HashDouble(ratio_after_move_, seed));
  }
  /// Like Hash, for an unfinished iteration.
  std::uint64_t HashAttempt(std::uint64_t seed) const {
    return HashDouble(weight_, HashDouble(refused_ ? 1 : 0, seed));
  }

 private:
  static constexpr double kSmallestWeight = 1e-4;  // a smaller weight is set to zero
  static constexpr double kLargestWeight = 1e12;
  static constexpr double kFirstRatio =
      0.1;  // first ratio after a refusal if no weight was needed before
  static constexpr double kFarRatio = 2;        // smallest ratio above kFarResidual
  static constexpr double kFarResidual = 5e-3;  // residual

  double ratio_ = 0;             // weight over residual that last worked
  double ratio_after_move_ = 0;  // same, of the first iteration after a move
  double weight_ = 0;
  bool refused_ = false;  // an attempt of this iteration was refused
};

}  // namespace torquer
