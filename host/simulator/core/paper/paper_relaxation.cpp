#include "host/simulator/core/paper/paper_relaxation.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace torquer {

using Eigen::Vector3d;

bool InsertSegment(const WireModel& model, WireState& state) {
  const double lambda = model.segment_mm();
  if (state.insertion_mm() + lambda > model.max_length_mm() + 1e-9 * lambda) return false;
  const int before_tip = std::max(0, state.segments() - model.tip_segments());
  const Vector3d direction =
      before_tip == 0 ? model.sheath().direction : state.tangents()[before_tip - 1];
  state.InsertSegment(model, before_tip, direction);
  return true;
}

bool RetractSegment(const WireModel& model, WireState& state) {
  if (state.segments() == 0) return false;
  state.RemoveSegment(model, std::max(0, state.segments() - model.tip_segments() - 1));
  return true;
}

PaperRelaxation::PaperRelaxation(const WireModel& model, const ClearanceField& field,
                                 const WallModel& wall, const PaperSettings& settings)
    : Relaxation(model),
      model_(model),
      settings_(settings),
      mechanics_(model, field, wall, no_terms_),
      physical_(model, field, wall, settings.physical),
      geometrical_(model, field, settings.geometrical),
      current_(mechanics_.MakeQuadraticModel()) {
  assert(wall.points_per_segment == 1);
}

void PaperRelaxation::InterruptCycles(WireState& state) {
  physical_.Restart(state);
  geometrical_.Interrupt();
  physical_done_ = false;
}

void PaperRelaxation::Restart(WireState& state) {
  state.UntwistFrames(model_);
  InterruptCycles(state);
  mechanics_.points().Forget();
  mechanics_.BuildGradient(state, current_);
  up_to_date_ = true;
}

void PaperRelaxation::CopyFrom(const Relaxation& twin, const WireState& /*state*/) {
  const auto& from = dynamic_cast<const PaperRelaxation&>(twin);
  mechanics_.points().CopyFrom(from.mechanics_.points());
  physical_.CopyFrom(from.physical_);
  geometrical_.CopyFrom(from.geometrical_);
  physical_done_ = from.physical_done_;
  up_to_date_ = from.up_to_date_;
  updates_before_ = from.updates_before_;
  current_ = from.current_;
}

// Selects the next action: only whole segments move; the remainder is carried.
PaperRelaxation::Action PaperRelaxation::NextAction(const InstrumentPoses& goal,
                                                    const WireState& state) const {
  // A feed that is short of a segment only by rounding counts as one.
  constexpr double kWhole = 1 - 1e-9;
  const double left = goal[0].insertion_mm - state.insertion_mm();
  const double last = state.segments() == 1 ? state.first_segment_mm() : model_.segment_mm();
  if (left >= model_.segment_mm() * kWhole) return Action::kInsert;
  if (state.segments() > 0 && left <= -last * kWhole) return Action::kRetract;
  return goal[0].rotation_rad == state.rotation_rad() ? Action::kNone : Action::kRotate;
}

bool PaperRelaxation::Arrived(const InstrumentPoses& goal, const WireState& state) const {
  return NextAction(goal, state) == Action::kNone;
}

void PaperRelaxation::Begin(WireState& /*state*/) {
  ended_.reset();
  updates_before_ = physical_.updates();
}

int PaperRelaxation::Move(const InstrumentPoses& goal, WireState& state) {
  switch (NextAction(goal, state)) {
    case Action::kInsert:
      InsertSegment(model_, state);
      break;
    case Action::kRetract:
      RetractSegment(model_, state);
      break;
    default: {
      // One motion after the other: the feed waits.
      const InstrumentPoses here = state.poses();
      const InstrumentPoses turned(here[0].insertion_mm, goal[0].rotation_rad);
      const InstrumentPoses next =
          stack().Towards(turned, here, model_.segment_mm(), settings_.max_turn_rad);
      state.Rotate(next[0].rotation_rad);
    }
  }
  InterruptCycles(state);
  physical_.RelaxTip(state);
  up_to_date_ = false;
  return 1;
}

// A wire in equilibrium needs no cycle.
bool PaperRelaxation::AtRest(WireState& state) {
  if (!ended_) {
    BringUpToDate(state);
    ended_ = settings_.cycles == PaperCycles::kNone || state.segments() == 0 ||
             current_.residual <= settings_.tolerance;
  }
  return *ended_;
}

void PaperRelaxation::Relax(WireState& state, TickReport& report) {
  ended_ = RelaxSlice(state);
  up_to_date_ = false;
  ++report.iterations;
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

void PaperRelaxation::BringUpToDate(const WireState& state) {
  if (!up_to_date_) mechanics_.BuildGradient(state, current_);
  up_to_date_ = true;
}

void PaperRelaxation::End(const WireState& state, bool /*settled*/, TickReport& report) {
  BringUpToDate(state);
  report.updates = physical_.updates() - updates_before_;
  report.converged = current_.residual <= settings_.tolerance;
  report.residual = current_.residual;
  report.max_penetration_mm = current_.max_penetration_mm;
}

}  // namespace torquer
