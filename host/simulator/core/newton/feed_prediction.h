// How a wire will relax after a feed, from how it did after the feed before.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// A feed is much like the one before. How every segment turned while the wire came to rest after
/// the last one, in proportion to their lengths, is added at once after the next (README, section
/// 8). Segments are counted from the tip. No heap after construction.
class FeedPrediction {
 public:
  explicit FeedPrediction(const WireModel& model);

  /// Nothing to go by: the next feed is not predicted.
  void Forget() { fed_mm_ = 0; }
  /// Feeds the state to `to_mm` (WireState::Feed) and turns it by what is predicted: nothing where
  /// the hand turned back, fed more than six times as much, or a segment would turn by more than
  /// 0.1 rad.
  void Feed(const WireModel& model, double to_mm, WireState& state);
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  void Turn(const WireModel& model, double ratio, WireState& state);

  std::vector<Eigen::Vector3d> fed_;    // tangents right after the last feed
  std::vector<Eigen::Vector3d> drift_;  // how they have turned since, rad; the most distal first
  double fed_mm_ = 0;                   // the last feed; 0 if none to go by
};

}  // namespace torquer
