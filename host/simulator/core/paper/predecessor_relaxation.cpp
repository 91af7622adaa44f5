#include "host/simulator/core/paper/predecessor_relaxation.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace torquer {

using Eigen::Vector3d;

namespace {

PhysicalSettings Unbounded() {
  PhysicalSettings settings;
  settings.rule = UpdateRule::kSigned;
  settings.max_update = std::numeric_limits<double>::infinity();
  return settings;
}

}  // namespace

PredecessorRelaxation::PredecessorRelaxation(const WireModel& model, const ClearanceField& field,
                                             const WallModel& wall,
                                             const PredecessorSettings& settings)
    : model_(model),
      settings_(settings),
      mechanics_(model, field, wall, no_terms_),
      physical_(model, field, wall, Unbounded()),
      current_(mechanics_.MakeExpansion()) {
  assert(model.law() == BendingLaw::kG2);
  assert(wall.points_per_segment == 1);
}

void PredecessorRelaxation::Restart(WireState& state) {
  TransportNormals(model_, state);
  physical_.Restart(state);
  mechanics_.ForgetLookups();
  mechanics_.ExpandGradient(state, current_);
}

double PredecessorRelaxation::Carried(const HandTarget& target, const WireState& state) const {
  return std::clamp(target.insertion_mm, 0.0, model_.max_length_mm()) - state.insertion_mm;
}

void PredecessorRelaxation::Cycle(WireState& state) {
  physical_.Restart(state);
  physical_.ContinueCycle(std::numeric_limits<std::int64_t>::max(), state);
}

void PredecessorRelaxation::Step(const HandTarget& target, WireState& state) {
  const double left = Carried(target, state);
  const double turn = target.rotation_rad - state.rotation_rad;
  if (left != 0) {
    const double longest = settings_.feed_segments * model_.segment_mm();
    const bool last = std::abs(left) <= longest;
    const double feed = last ? left : std::copysign(longest, left);
    state.insertion_mm = last ? std::clamp(target.insertion_mm, 0.0, model_.max_length_mm())
                              : state.insertion_mm + feed;
    // Fed at the base, the wire is pushed forward as it lies.
    FeedFirstSegment(model_, state);
    PlaceNodes(model_, 1, state);
    TransportNormals(model_, state);
  }
  if (turn != 0) {
    state.SetRotation(std::abs(turn) <= settings_.max_turn_rad
                          ? target.rotation_rad
                          : state.rotation_rad + std::copysign(settings_.max_turn_rad, turn));
  }
  if (state.segments() > 0) Cycle(state);
}

TickReport PredecessorRelaxation::Tick(const HandTarget& target, WorkBudget& budget,
                                       WireState& state) {
  TickReport report;
  const Vector3d tip_before = state.nodes.back();
  const double insertion_before = state.insertion_mm;
  const double rotation_before = state.rotation_rad;
  const std::int64_t updates_before = physical_.updates();

  const auto pending = [&] {
    return Carried(target, state) != 0 || target.rotation_rad != state.rotation_rad;
  };
  while (pending() && !report.budget_spent) {
    if (Grant(budget, report)) {
      Step(target, state);
      ++report.actions;
    } else {
      report.budget_spent = true;
    }
  }
  if (report.actions == 0 && state.segments() > 0 && current_.residual > settings_.tolerance) {
    if (Grant(budget, report)) {
      Cycle(state);
      ++report.iterations;
    } else {
      report.budget_spent = true;
    }
  }
  if (report.work > 0) mechanics_.ExpandGradient(state, current_);

  report.updates = physical_.updates() - updates_before;
  report.converged = current_.residual <= settings_.tolerance;
  report.carried_mm = Carried(target, state);
  report.energy_mJ = current_.energy_mJ;
  report.residual = current_.residual;
  report.max_penetration_mm = current_.max_penetration_mm;
  const double hand = std::abs(state.insertion_mm - insertion_before) +
                      10 * std::abs(state.rotation_rad - rotation_before);
  report.snapped = (state.nodes.back() - tip_before).norm() > 3 * hand + 0.5;
  return report;
}

}  // namespace torquer
