// How much the steps of Newton's method are damped.
#pragma once

#include <algorithm>
#include <cstdint>

#include "host/simulator/core/hash.h"

namespace torquer {

/// The damping weight of a step: mu times the local EI/(1 mm) (spins: GJ) is added to every
/// diagonal of the Hessian (README, section 7). mu = 0 is Newton's step, a large mu a short step
/// down the gradient. It is in proportion to the residual, which does not spoil the quadratic
/// convergence; the ratio that worked is remembered from tick to tick.
class Damping {
 public:
  /// The weight of the next attempt.
  double weight() const { return weight_; }

  /// Before the first attempt of an iteration.
  void Begin(double residual) {
    // Far from balance some is always needed: contacts would come and go in turns.
    const double ratio = residual > kFarResidual ? std::max(ratio_, kFarRatio) : ratio_;
    weight_ = ratio * residual;
    if (weight_ < kSmallestWeight) weight_ = 0;
    refused_ = false;
  }
  /// After an attempt without success. False where no larger weight makes sense: then a step would
  /// be shorter than rounding.
  bool Raise(double residual) {
    refused_ = true;
    weight_ = std::max({10 * weight_, kFirstRatio * residual, kSmallestWeight});
    return weight_ <= kLargestWeight;
  }
  /// After a step that was taken; `well`: undamped in length, and it gained about what was
  /// expected.
  void Accept(double residual, bool well, bool after_move) {
    if (refused_) {
      ratio_ = weight_ / residual;
    } else if (weight_ > 0 && well) {
      ratio_ /= 1.5;  // what was enough at once may be less next time
    }
    if (after_move) ratio_after_move_ = ratio_;
  }
  /// After a move: what worked after the last one.
  void Move() { ratio_ = ratio_after_move_; }
  /// As at the start.
  void Forget() { ratio_ = ratio_after_move_ = 0; }
  /// Nothing to go by for the next move.
  void ForgetMoves() { ratio_after_move_ = 0; }

  std::uint64_t Hash(std::uint64_t seed) const {
    return HashDouble(ratio_, HashDouble(ratio_after_move_, seed));
  }
  /// The same of an iteration that is not at its end.
  std::uint64_t HashAttempt(std::uint64_t seed) const {
    return HashDouble(weight_, HashDouble(refused_ ? 1 : 0, seed));
  }

 private:
  static constexpr double kSmallestWeight = 1e-4;  // below it none is used
  static constexpr double kLargestWeight = 1e12;
  static constexpr double kFirstRatio = 0.1;    // where none was needed so far
  static constexpr double kFarRatio = 2;        // least one above a residual
  static constexpr double kFarResidual = 5e-3;  // of this size

  double ratio_ = 0;             // weight over residual that last worked
  double ratio_after_move_ = 0;  // the same of the first iteration after a move
  double weight_ = 0;
  bool refused_ = false;  // an attempt of this iteration was
};

}  // namespace torquer
