// Feed prediction: extrapolates the relaxation after a feed from that after the previous feed.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/curve.h"
#include "host/simulator/core/newton/segment_turns.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

/// Predicts the relaxation after a feed (README, section 8). It repeats every segment's turn during
/// the relaxation after the previous feed, scaled by the ratio of the feeds. No heap after
/// construction.
class FeedPrediction {
 public:
  explicit FeedPrediction(const WireModel& model);

  /// Forgets the previous feed: the next feed is not predicted.
  void Forget() { fed_mm_ = 0; }
  /// The relaxation after the last feed ends with `curve`. Without this call it ends at the next
  /// feed.
  void Finish(const Curve& curve);
  /// Feeds the curve to `to_mm` (Curve::Feed) and applies the predicted turns. Makes no prediction
  /// if the hand turned back, or fed more than six times as much. Makes none beyond the limits of
  /// SegmentTurns::Repeat.
  void Feed(const WireModel& model, double to_mm, double most_mm, Curve& curve);
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  std::vector<Eigen::Vector3d> fed_;  // tangents right after the last feed
  SegmentTurns turns_;                // since then, if `finished_`
  bool finished_ = false;
  double fed_mm_ = 0;  // last feed; 0 without one
};

}  // namespace torquer
