#include "host/simulator/core/relaxation.h"

#include <array>
#include <cmath>
#include <cstddef>

namespace torquer {

namespace {

// Asks `budget` for one more unit, and counts it in `report` when it is granted.
bool Grant(WorkBudget& budget, TickReport& report) {
  if (!budget.Allows(report.work)) return false;
  ++report.work;
  return true;
}

// Tip of each curve.
using Tips = std::array<Eigen::Vector3d, kMostInstruments>;

Tips TipsOf(const WireState& state) {
  Tips tips;
  for (int c = 0; c < state.curves(); ++c) {
    tips[c] = state.curve(c).tip();
  }
  return tips;
}

// True if a tip moved much farther than the hands explain. A turn moves a bent tip by its length
// times the angle in rad; 10 mm is a long tip.
bool Snapped(const Tips& before_mm, const InstrumentPoses& before, const WireState& state) {
  constexpr double kBentTipMm = 10;
  double hands_mm = 0;
  for (int k = 0; k < before.size(); ++k) {
    const InstrumentPose& now = state.poses()[k];
    hands_mm += std::abs(now.insertion_mm - before[k].insertion_mm) +
                kBentTipMm * std::abs(now.rotation_rad - before[k].rotation_rad);
  }
  const Tips now_mm = TipsOf(state);
  for (int c = 0; c < state.curves(); ++c) {
    if ((now_mm[c] - before_mm[c]).norm() > 3 * hands_mm + 0.5) return true;
  }
  return false;
}

}  // namespace

InstrumentPoses MotionLeft(const InstrumentPoses& goal, const InstrumentPoses& here) {
  InstrumentPoses left(goal.size());
  for (int k = 0; k < goal.size(); ++k) {
    left[k] = {goal[k].insertion_mm - here[k].insertion_mm,
               goal[k].rotation_rad - here[k].rotation_rad};
  }
  return left;
}

double Relaxation::EnergyMJ(const WireState& state) const {
  double energy_mJ = Current().energy_mJ - Current().dissipated_mJ;
  for (int c = 0; c < state.curves(); ++c) energy_mJ += rods_.MutualEnergyMJ(c, state.curve(c));
  return energy_mJ;
}

TickReport Relaxation::Tick(const InstrumentPoses& target, WorkBudget& budget, WireState& state) {
  TickReport report;
  const Tips tips_before_mm = TipsOf(state);
  const InstrumentPoses poses_before = state.poses();
  const InstrumentPoses goal = stack().Bounded(target);

  Begin(state);
  bool at_rest = false;
  while (true) {
    const bool arrived = Arrived(goal, state);
    const bool move = !arrived && MayMove();
    if (!move) at_rest = AtRest(state);
    if (arrived && at_rest) break;
    if (!Grant(budget, report)) break;
    if (move || at_rest) {
      report.actions += Move(goal, state);
      at_rest = false;
    } else {
      Relax(state, report);
    }
  }
  const bool settled = at_rest && Arrived(goal, state);
  End(state, settled, report);
  report.energy_mJ = EnergyMJ(state);

  report.converged = report.converged && at_rest;
  report.budget_spent = !settled;
  report.carried = MotionLeft(goal, state.poses());
  report.snapped = Snapped(tips_before_mm, poses_before, state);
  return report;
}

}  // namespace torquer
