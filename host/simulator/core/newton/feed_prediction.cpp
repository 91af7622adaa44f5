#include "host/simulator/core/newton/feed_prediction.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "host/simulator/core/hash.h"

namespace torquer {

using Eigen::Vector3d;

namespace {

constexpr double kLargestRatio = 6;
constexpr double kLargestTurnRad = 0.1;

}  // namespace

FeedPrediction::FeedPrediction(const WireModel& model) {
  const auto room = static_cast<std::size_t>(model.max_segments()) + 1;
  fed_.reserve(room);
  drift_.reserve(room);
}

void FeedPrediction::Feed(const WireModel& model, double to_mm, double most_mm, Curve& curve) {
  const std::size_t before = curve.tangents().size();
  drift_.clear();
  if (fed_mm_ != 0 && fed_.size() == before) {
    for (std::size_t k = 0; k < before; ++k) {
      const std::size_t i = before - 1 - k;
      drift_.push_back(fed_[i].cross(curve.tangents()[i]));
    }
  }
  const double feed_mm = to_mm - curve.insertion_mm();
  curve.Feed(model, to_mm);
  fed_ = curve.tangents();
  const double ratio = fed_mm_ != 0 ? feed_mm / fed_mm_ : 0;
  fed_mm_ = feed_mm;
  if (ratio > 0 && ratio < kLargestRatio) Turn(model, ratio, most_mm, curve);
}

// True if the predicted tangents in drift_ move a node by more than `most_mm`.
bool FeedPrediction::MovesTooFar(const WireModel& model, double most_mm, const Curve& curve) const {
  if (most_mm == std::numeric_limits<double>::infinity()) return false;
  const std::size_t n = curve.tangents().size();
  Vector3d moved_mm = Vector3d::Zero();
  for (std::size_t k = drift_.size(); k-- > 0;) {
    const std::size_t i = n - 1 - k;
    moved_mm += curve.SegmentLength(model, static_cast<int>(i)) * (drift_[k] - curve.tangents()[i]);
    if (moved_mm.squaredNorm() > most_mm * most_mm) return true;
  }
  return false;
}

void FeedPrediction::Turn(const WireModel& model, double ratio, double most_mm, Curve& curve) {
  double longest = 0;
  for (const Vector3d& turn : drift_) longest = std::max(longest, turn.squaredNorm());
  if (ratio * std::sqrt(longest) > kLargestTurnRad) return;
  const std::size_t n = curve.tangents().size();
  drift_.resize(std::min(n, drift_.size()));
  for (std::size_t k = 0; k < drift_.size(); ++k) {
    const Vector3d& u = curve.tangents()[n - 1 - k];
    drift_[k] = (u + ratio * drift_[k].cross(u)).normalized();
  }
  if (!MovesTooFar(model, most_mm, curve)) curve.TurnDistal(model, drift_);
}

std::uint64_t FeedPrediction::Hash(std::uint64_t seed) const {
  if (fed_mm_ == 0) return seed;
  return HashVectors(fed_, HashDouble(fed_mm_, seed));
}

}  // namespace torquer
