#include "host/simulator/core/newton/feed_prediction.h"

#include <cstddef>

#include "host/simulator/core/hash.h"

namespace torquer {

FeedPrediction::FeedPrediction(const WireModel& model) : turns_(model) {
  fed_.reserve(model.max_segments() + 1);
}

void FeedPrediction::Finish(const Curve& curve) {
  if (fed_mm_ == 0 || finished_) return;
  turns_.Clear();
  if (fed_.size() == curve.tangents().size()) turns_.Measure(fed_, curve.tangents());
  finished_ = true;
}

void FeedPrediction::Feed(const WireModel& model, double to_mm, double most_mm, Curve& curve) {
  Finish(curve);
  const double feed_mm = to_mm - curve.insertion_mm();
  curve.Feed(model, to_mm);
  fed_ = curve.tangents();
  const double ratio = fed_mm_ != 0 ? feed_mm / fed_mm_ : 0;
  fed_mm_ = feed_mm;
  finished_ = false;
  constexpr double kLargestRatio = 6;
  if (ratio > 0 && ratio < kLargestRatio) turns_.Repeat(model, ratio, most_mm, curve);
}

std::uint64_t FeedPrediction::Hash(std::uint64_t seed) const {
  if (fed_mm_ == 0) return seed;
  seed = HashVectors(fed_, HashDouble(fed_mm_, seed));
  return finished_ ? turns_.Hash(seed) : seed;
}

}  // namespace torquer
