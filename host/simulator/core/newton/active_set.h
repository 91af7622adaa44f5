// Which points near the wall feel it in the model of a step.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// A step of a curve, and the displacement of every segment's proximal node by it.
struct CurveStep {
  const std::vector<Eigen::Vector2d>& xi;
  const std::vector<Eigen::Vector3d>& displacement_mm;
};

/// In the model every near point is a one-sided spring; those in the set act. One entry for each of
/// Expansion::springs. No heap after construction.
class ActiveSet {
 public:
  /// `points`: the most that a wire has.
  explicit ActiveSet(std::size_t points);

  /// Takes over which points press, before the wire is moved.
  void RememberPressed(const Expansion& expansion);
  /// As at the start: none pressed.
  void Forget();
  /// The set to begin with. After a move that which pressed before it: sliding along itself, the
  /// wire cuts corners by more than it is pressed in, and which points press hardly changes.
  void Begin(const Expansion& expansion, bool moved);
  /// The set after a step: exactly the points that would press. Returns the most distal segment
  /// with a change, or -1 where there is none.
  int Update(const WireState& state, const Expansion& expansion, const CurveStep& step);
  /// The same of points on two curves.
  int Update(const WireState& state, const Expansion& expansion, const CurveStep& step,
             const CurveStep& second);
  /// The model's energy without a step, with this set instead of the points that press, mJ.
  double EnergyAtRest(const Expansion& expansion) const;

  const std::vector<std::uint8_t>& active() const { return active_; }
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  template <class MovedBy>
  int UpdateBy(const WireState& state, const Expansion& expansion, MovedBy moved_by);

  std::vector<std::uint8_t> active_;
  std::vector<std::uint8_t> pressed_;  // before the last move; by PointSet::FromTip
};

/// The same of the springs between two curves; without a memory, since what lies in a lumen has its
/// contacts after a move about where they were.
class BetweenSet {
 public:
  /// `springs`: the most that there are.
  explicit BetweenSet(std::size_t springs) { active_.reserve(springs); }

  /// Those that touch.
  void Begin(const BetweenCurves& between);
  /// The set after a step, as ActiveSet::Update.
  int Update(const WireState& state, const Expansion& expansion, const CurveStep& step,
             const CurveStep& second);
  /// As ActiveSet::EnergyAtRest.
  double EnergyAtRest(const BetweenCurves& between) const;

  const std::vector<std::uint8_t>& active() const { return active_; }

 private:
  std::vector<std::uint8_t> active_;
};

}  // namespace torquer
