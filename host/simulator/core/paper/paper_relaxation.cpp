#include "host/simulator/core/paper/paper_relaxation.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace torquer {

using Eigen::Vector3d;

namespace {

// Segments are equal, but for a first one left over from the start.
void Renew(const WireModel& model, WireState& state) {
  PlaceNodes(model, 1, state);
  TransportNormals(model, state);
}

}  // namespace

bool InsertSegment(const WireModel& model, WireState& state) {
  const double lambda = model.segment_mm();
  if (state.insertion_mm + lambda > model.max_length_mm() + 1e-9 * lambda) return false;
  const int n = state.segments();
  const int before_tip = std::max(0, n - model.tip_segments());
  const Vector3d direction =
      before_tip == 0 ? model.sheath().direction : state.tangents[before_tip - 1];
  state.tangents.insert(state.tangents.begin() + before_tip, direction);
  // A segment inserted at the sheath goes before the short first one only in name: lengths are
  // properties of places, and place 0 keeps its own.
  if (n == 0) {
    state.first_segment_mm = lambda;
    state.insertion_mm = 0;
  }
  state.insertion_mm += lambda;
  Renew(model, state);
  return true;
}

bool RetractSegment(const WireModel& model, WireState& state) {
  const int n = state.segments();
  if (n == 0) return false;
  const int last_shaft = std::max(0, n - model.tip_segments() - 1);
  state.tangents.erase(state.tangents.begin() + last_shaft);
  state.insertion_mm -= n == 1 ? state.first_segment_mm : model.segment_mm();
  if (n == 1) {
    state.first_segment_mm = 0;
    state.insertion_mm = 0;
  }
  Renew(model, state);
  return true;
}

PaperRelaxation::PaperRelaxation(const WireModel& model, const ClearanceField& field,
                                 const WallModel& wall, const PaperSettings& settings)
    : model_(model),
      settings_(settings),
      mechanics_(model, field, wall, no_terms_),
      physical_(model, field, wall, settings.physical),
      geometrical_(model, field, settings.geometrical),
      current_(mechanics_.MakeExpansion()) {
  assert(wall.points_per_segment == 1);
}

void PaperRelaxation::InterruptCycles(WireState& state) {
  physical_.Restart(state);
  geometrical_.Interrupt();
  physical_done_ = false;
}

void PaperRelaxation::Restart(WireState& state) {
  TransportNormals(model_, state);
  InterruptCycles(state);
  mechanics_.ForgetLookups();
  mechanics_.ExpandGradient(state, current_);
}

double PaperRelaxation::Carried(const HandTarget& target, const WireState& state) const {
  return std::clamp(target.insertion_mm, 0.0, model_.max_length_mm()) - state.insertion_mm;
}

bool PaperRelaxation::ActionPending(const HandTarget& target, const WireState& state) const {
  if (target.rotation_rad != state.rotation_rad) return true;
  // A feed that rounding left a trifle short of a segment is one.
  const double left = Carried(target, state);
  const double last = state.segments() == 1 ? state.first_segment_mm : model_.segment_mm();
  return left >= model_.segment_mm() * (1 - 1e-9) ||
         (state.segments() > 0 && left <= -last * (1 - 1e-9));
}

void PaperRelaxation::Act(const HandTarget& target, WireState& state) {
  const double left = Carried(target, state);
  const double last = state.segments() == 1 ? state.first_segment_mm : model_.segment_mm();
  if (left >= model_.segment_mm() * (1 - 1e-9)) {
    InsertSegment(model_, state);
  } else if (state.segments() > 0 && left <= -last * (1 - 1e-9)) {
    RetractSegment(model_, state);
  } else {
    const double turn = target.rotation_rad - state.rotation_rad;
    state.SetRotation(std::abs(turn) <= settings_.max_turn_rad
                          ? target.rotation_rad
                          : state.rotation_rad + std::copysign(settings_.max_turn_rad, turn));
  }
  InterruptCycles(state);
  physical_.RelaxTip(state);
}

bool PaperRelaxation::RelaxSlice(WireState& state) {
  const std::int64_t m = physical_.TipIterations(state);
  if (!physical_done_) {
    if (!physical_.ContinueCycle(m * (m + 1) / 2, state)) return false;
    physical_done_ = settings_.cycles == PaperCycles::kGeometrical;
    return !physical_done_;
  }
  if (geometrical_.active() || geometrical_.Begin(state)) {
    const std::int64_t sweeps =
        std::max<std::int64_t>(1, m * (m + 1) / geometrical_.interval().length());
    if (!geometrical_.Continue(static_cast<int>(sweeps), state)) return false;
    physical_.Restart(state);
  }
  physical_done_ = false;
  return true;
}

TickReport PaperRelaxation::Tick(const HandTarget& target, WorkBudget& budget, WireState& state) {
  TickReport report;
  const Vector3d tip_before = state.nodes.back();
  const double insertion_before = state.insertion_mm;
  const double rotation_before = state.rotation_rad;
  const std::int64_t updates_before = physical_.updates();

  // Fig. 10: an action is always first.
  while (ActionPending(target, state) && !report.budget_spent) {
    if (Grant(budget, report)) {
      Act(target, state);
      ++report.actions;
    } else {
      report.budget_spent = true;
    }
  }
  if (report.actions > 0) mechanics_.ExpandGradient(state, current_);
  bool ended = settings_.cycles == PaperCycles::kNone || state.segments() == 0 ||
               current_.residual <= settings_.tolerance;
  while (!ended && !report.budget_spent) {
    if (Grant(budget, report)) {
      ended = RelaxSlice(state);
      ++report.iterations;
    } else {
      report.budget_spent = true;
    }
  }
  if (report.iterations > 0) mechanics_.ExpandGradient(state, current_);

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
