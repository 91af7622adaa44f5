#include "host/simulator/core/newton/segment_turns.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>

#include "host/simulator/core/hash.h"

namespace torquer {

using Eigen::Vector3d;

SegmentTurns::SegmentTurns(const WireModel& model) {
  const auto room = static_cast<std::size_t>(model.max_segments()) + 1;
  turns_rad_.reserve(room);
  tangents_.reserve(room);
}

void SegmentTurns::Measure(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to) {
  assert(from.size() == to.size());
  turns_rad_.clear();
  for (std::size_t i = from.size(); i-- > 0;) turns_rad_.push_back(from[i].cross(to[i]));
}

void SegmentTurns::Repeat(const WireModel& model, double ratio, double most_mm, Curve& curve) {
  constexpr double kLargestTurnRad = 0.1;
  double longest = 0;
  for (const Vector3d& turn : turns_rad_) longest = std::max(longest, turn.squaredNorm());
  if (ratio * std::sqrt(longest) > kLargestTurnRad) return;
  const std::size_t n = curve.tangents().size();
  tangents_.clear();
  for (std::size_t k = 0; k < std::min(n, turns_rad_.size()); ++k) {
    const Vector3d& u = curve.tangents()[n - 1 - k];
    tangents_.push_back((u + ratio * turns_rad_[k].cross(u)).normalized());
  }
  if (!MovesTooFar(model, most_mm, curve)) curve.TurnDistal(model, tangents_);
}

// True if the predicted tangents move a node by more than `most_mm`.
bool SegmentTurns::MovesTooFar(const WireModel& model, double most_mm, const Curve& curve) const {
  if (most_mm == std::numeric_limits<double>::infinity()) return false;
  const std::size_t n = curve.tangents().size();
  Vector3d moved_mm = Vector3d::Zero();
  for (std::size_t k = tangents_.size(); k-- > 0;) {
    const std::size_t i = n - 1 - k;
    moved_mm +=
        curve.SegmentLength(model, static_cast<int>(i)) * (tangents_[k] - curve.tangents()[i]);
    if (moved_mm.squaredNorm() > most_mm * most_mm) return true;
  }
  return false;
}

std::uint64_t SegmentTurns::Hash(std::uint64_t seed) const { return HashVectors(turns_rad_, seed); }

}  // namespace torquer
