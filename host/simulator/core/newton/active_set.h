// Active sets: the one-sided springs that act in the current quadratic model.
//
// In the one-sided model a spring acts exactly where it penetrates. The minimum s for a set need
// not be a minimum of that model. Penetrations are linear on the way from the best point x so far
// to s. So the minimum of the one-sided model on this way is found exactly (README, section 8).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/newton/curve_step.h"
#include "host/simulator/core/wire_mechanics.h"

namespace torquer {

/// Springs of the model, and the set of those that act. x and s are 0 steps at first. No heap after
/// construction.
class SpringSet {
 public:
  /// True for each spring that acts.
  const std::vector<std::uint8_t>& active() const { return active_; }
  /// True if the set is not that of the springs that penetrate at s.
  bool is_wrong() const { return is_wrong_; }

  /// Energy of the set's springs minus that of one-sided springs, mJ. It is given without a step,
  /// at x, and at a fraction of the way from x to s.
  double ExcessAtRest() const;
  double ExcessAtBest() const { return ExcessAt(0); }
  double ExcessAt(double fraction) const;
  /// Derivative of ExcessAt, mJ.
  double ExcessSlopeAt(double fraction) const;
  /// Moves x by a fraction of the way to s.
  void MoveBest(double fraction);

 protected:
  explicit SpringSet(std::size_t most_springs);
  /// Takes over the springs of a new model, with x = 0. active_ is then undefined.
  template <class Spring>
  void Reset(const std::vector<Spring>& springs);
  /// Makes the set those springs that penetrate at x. Returns the last spring with a change, or -1.
  int TakePressing();

  std::vector<std::uint8_t> active_;
  std::vector<double> solution_mm_;  ///< penetrations at s
  bool is_wrong_ = false;

 private:
  template <class Penetration>
  double Excess(Penetration penetration_mm) const;
  double PenetrationAt(std::size_t k, double fraction) const {
    return best_mm_[k] + fraction * (solution_mm_[k] - best_mm_[k]);
  }

  std::vector<double> stiffness_N_mm_;
  std::vector<double> rest_mm_;  // penetrations without a step
  std::vector<double> best_mm_;  // and at x
};

/// Active set of the wall springs of a curve: one entry for each of CurveQuadraticModel::springs.
class ActiveSet : public SpringSet {
 public:
  /// `points`: largest number of points of a curve.
  explicit ActiveSet(std::size_t points);

  /// Stores the forces of the points that touch the wall, before the wire is moved.
  void RememberPressed(const CurveQuadraticModel& quadratic);
  /// Resets to the initial state: no stored contacts.
  void Forget();
  /// Initializes the set. After a move it takes the points that touched before the move, and lets
  /// the springs press as they did. A wire that slides along itself cuts corners by more than its
  /// penetration, and its contacts hardly change.
  void Begin(bool moved, CurveQuadraticModel& quadratic);
  /// Finds the penetrations at s, the state after `step`.
  void Look(const Curve& curve, const CurveQuadraticModel& quadratic, const CurveStep& step);
  /// Makes the set those springs that penetrate at x. Returns the most distal segment with a
  /// change, or -1.
  int Update(const CurveQuadraticModel& quadratic);

  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  std::vector<double> pressed_N_;  // forces before the last move; by PointSet::FromTip
};

/// Active set of the springs between two curves. It keeps no memory, because contacts in a lumen
/// hardly move when the wire is moved.
class BetweenSet : public SpringSet {
 public:
  /// `springs`: largest number of springs.
  explicit BetweenSet(std::size_t springs) : SpringSet(springs) {}

  /// Initializes the set with the touching springs.
  void Begin(const BetweenCurves& between);
  /// Like ActiveSet::Look.
  void Look(const WireState& state, const WireMechanics& mechanics, const QuadraticModel& quadratic,
            const BetweenCurves& between, const std::vector<CurveStep>& steps);
  /// Like ActiveSet::Update. Returns the most distal group of segments with a change, or -1.
  int Update(const BetweenCurves& between);
};

}  // namespace torquer
