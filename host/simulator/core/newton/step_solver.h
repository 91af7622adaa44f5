// Step of an iteration: the minimum of the quadratic model with one-sided contact springs.
#pragma once

#include <Eigen/Core>
#include <type_traits>
#include <vector>

#include "host/simulator/core/newton/active_set.h"
#include "host/simulator/core/newton/front_sweep.h"
#include "host/simulator/core/newton/riccati_sweep.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Finds a step and applies it. `Sweep`: solver of one quadratic problem. RiccatiSweep serves a
/// lone wire and instruments on one curve that do not twist; FrontSweep serves all others. No heap
/// after construction.
template <class Sweep>
class StepSolver {
 public:
  /// Result of Solve.
  struct Solution {
    /// Decrease of the energy that the model predicts, mJ; negative if the model has no minimum or
    /// none was found. There is no step then.
    double expected_mJ = -1;
    int rounds = 0;         ///< active sets that were tried
    bool definite = false;  ///< the Hessian of the last active set is positive definite
  };

  /// Keeps a reference.
  explicit StepSolver(const WireMechanics& mechanics);

  /// Replaces the loads of `at` by those of the model with the initial active sets. `moved`: the
  /// wire was moved, and no step accepted since. `wall_sets`: one for each curve.
  void Begin(const WireState& state, bool moved, std::vector<ActiveSet>& wall_sets,
             QuadraticModel& at);
  /// Minimizes the model, in which every near point has a one-sided spring. This is Newton's method
  /// with an exact line search on a piecewise quadratic function. Leaves the loads of the last
  /// active set in `at`.
  Solution Solve(const WireState& state, double weight, bool moved,
                 std::vector<ActiveSet>& wall_sets, QuadraticModel& at);
  /// Sets `trial` to `state` after the fraction `scale` of the step.
  void Apply(const WireState& state, const QuadraticModel& at, double scale,
             WireState& trial) const;
  /// Largest fraction of the step, at most 1, with which curves beside each other cannot pass
  /// through each other. No two of them move against each other by more than half of their
  /// distance.
  double PassingScale(const WireState& state, const QuadraticModel& at) const;
  /// Largest turn of a segment or spin by the step, rad.
  double LargestTurn() const;
  /// Largest displacement of a node by the step, mm. `shift_mm`: optional, added to the
  /// displacements of the innermost curve.
  double LongestMoveMm(const WireState& state, const QuadraticModel& at,
                       const std::vector<Eigen::Vector3d>* shift_mm = nullptr) const;

  /// True if Hessian + damping weight is positive definite with the loads of `at`.
  bool IsDefinite(const WireState& state, const QuadraticModel& at, double weight);
  /// Largest displacement of a node by Newton's step without damping, plus the node's `shift_mm` if
  /// given, mm. NaN if the Hessian is not positive definite. Replaces the step.
  double NextStepMm(const WireState& state, const QuadraticModel& at,
                    const std::vector<Eigen::Vector3d>* shift_mm = nullptr);
  /// The innermost curve's part of Newton's step without damping. The Hessian must be positive
  /// definite. Replaces the step.
  const CurveStep& StepOf(const WireState& state, const QuadraticModel& at);
  /// Sets `trial` to `state` after a small push that excites every shape. Its direction is
  /// arbitrary, but always the same. Replaces the step.
  void Push(const WireState& state, const QuadraticModel& at, WireState& trial);

 private:
  static constexpr bool kFront = std::is_same_v<Sweep, FrontSweep>;

  static Sweep MakeSweep(const WireMechanics& mechanics);
  int curves() const { return static_cast<int>(steps_.size()); }
  bool Factor(const WireState& state, const QuadraticModel& at, double weight);
  bool Refactor(const WireState& state, const QuadraticModel& at, double weight, int changed);
  double Step(const WireState& state, const QuadraticModel& at);
  void TakeLoads(const WireState& state, const std::vector<ActiveSet>& wall_sets,
                 QuadraticModel& at) const;
  bool AnyWrong(const WireState& state, const QuadraticModel& at,
                std::vector<ActiveSet>& wall_sets);
  int UpdateSets(const QuadraticModel& at, std::vector<ActiveSet>& wall_sets);
  template <class Value>
  double Sum(const std::vector<ActiveSet>& wall_sets, Value value) const;
  double LineMinimum(const std::vector<ActiveSet>& wall_sets, double drop_mJ) const;
  Solution TakeBest(double best_mJ, int rounds, bool definite);
  void MoveBest(double fraction, bool first, std::vector<ActiveSet>& wall_sets);

  const WireMechanics& mechanics_;
  Sweep sweep_;
  std::vector<BetweenSet> between_sets_;  // by pair of curves
  std::vector<CurveStep> steps_;          // by curve; in Solve those to s
  std::vector<CurveStep> best_;           // and to x (active_set.h)
};

extern template class StepSolver<RiccatiSweep<BendStage>>;
extern template class StepSolver<RiccatiSweep<TwistStage>>;
extern template class StepSolver<FrontSweep>;

}  // namespace torquer
