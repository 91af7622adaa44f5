// Turns of segments over one relaxation, which a prediction repeats.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/curve.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

/// Turns of the segments of one curve. Segments are counted from the tip. No heap after
/// construction.
class SegmentTurns {
 public:
  explicit SegmentTurns(const WireModel& model);

  void Clear() { turns_rad_.clear(); }
  /// Stores the turns from one list of tangents to another of the same length.
  void Measure(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to);
  /// Turns the segments of `curve` by `ratio` times the turns. Turns no segment if one would turn
  /// by more than 0.1 rad, or a node move by more than `most_mm`.
  void Repeat(const WireModel& model, double ratio, double most_mm, Curve& curve);
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  bool MovesTooFar(const WireModel& model, double most_mm, const Curve& curve) const;

  std::vector<Eigen::Vector3d> turns_rad_;  // the most distal first
  std::vector<Eigen::Vector3d> tangents_;   // work space: predicted; the most distal first
};

}  // namespace torquer
