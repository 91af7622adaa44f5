// Active set: points with a contact spring in the current quadratic model.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/newton/curve_step.h"
#include "host/simulator/core/wire_mechanics.h"

namespace torquer {

/// Active set of the wall springs of a curve. In the model every near point is a one-sided spring;
/// springs in the set act. One entry for each of CurveQuadraticModel::springs. No heap after
/// construction.
class ActiveSet {
 public:
  /// `points`: largest number of points of a curve.
  explicit ActiveSet(std::size_t points);

  /// Stores the points that touch the wall, before the wire is moved.
  void RememberPressed(const CurveQuadraticModel& quadratic);
  /// Resets to the initial state: no stored contacts.
  void Forget();
  /// Initializes the set. After a move it takes the points that touched before the move. A wire
  /// that slides along itself cuts corners by more than its penetration, and its contacts hardly
  /// change.
  void Begin(const CurveQuadraticModel& quadratic, bool moved);
  /// Updates the set to exactly the points that would penetrate the wall after a step. Returns the
  /// most distal segment with a change, or -1 without a change.
  int Update(const Curve& curve, const CurveQuadraticModel& quadratic, const CurveStep& step);
  /// Model energy without a step, with the springs of this set instead of the touching points, mJ.
  double EnergyAtRest(const CurveQuadraticModel& quadratic) const;

  const std::vector<std::uint8_t>& active() const { return active_; }
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  std::vector<std::uint8_t> active_;
  std::vector<std::uint8_t> pressed_;  // touched before the last move; by PointSet::FromTip
};

/// Active set of the springs between two curves. It keeps no memory, because contacts in a lumen
/// hardly move when the wire is moved.
class BetweenSet {
 public:
  /// `springs`: largest number of springs.
  explicit BetweenSet(std::size_t springs) { active_.reserve(springs); }

  /// Initializes the set with the touching springs.
  void Begin(const BetweenCurves& between);
  /// Updates the set after a step, like ActiveSet::Update. Returns the most distal group of
  /// segments with a change, or -1.
  int Update(const WireState& state, const WireMechanics& mechanics,
             const QuadraticModel& quadratic, const BetweenCurves& between,
             const std::vector<CurveStep>& steps);
  /// Like ActiveSet::EnergyAtRest.
  double EnergyAtRest(const BetweenCurves& between) const;

  const std::vector<std::uint8_t>& active() const { return active_; }

 private:
  std::vector<std::uint8_t> active_;
};

}  // namespace torquer
