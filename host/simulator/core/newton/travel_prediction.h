// Travel prediction: extrapolates the motion of a wire that a moving vessel takes along.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/curve.h"
#include "host/simulator/core/newton/segment_turns.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

/// Predicts the relaxation after the vessel has moved (README, section 8). It repeats the turn of
/// every segment since the previous motion, scaled by the ratio of the travels. No heap after
/// construction.
class TravelPrediction {
 public:
  explicit TravelPrediction(const WireModel& model);

  /// Forgets the previous motion: the next one is not predicted.
  void Forget() { travel_mm_ = 0; }
  /// Applies the predicted turns to a curve whose vessel has moved by `travel_mm` >= 0
  /// (ClearanceField::LastTravelMm). Makes no prediction beyond the limits of SegmentTurns::Repeat,
  /// or if the vessel moved over four times as far as before.
  void Travel(const WireModel& model, double travel_mm, double most_mm, Curve& curve);
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  std::vector<Eigen::Vector3d> before_;  // tangents at the last call, before its turns
  SegmentTurns turns_;                   // work space
  double travel_mm_ = 0;                 // of the last call; 0 without one
};

}  // namespace torquer
