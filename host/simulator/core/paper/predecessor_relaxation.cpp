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
    : Relaxation(model),
      model_(model),
      settings_(settings),
      mechanics_(model, field, wall, no_terms_),
      physical_(model, field, wall, Unbounded()),
      current_(mechanics_.MakeQuadraticModel()) {
  assert(model.law() == BendingLaw::kG2);
  assert(wall.points_per_segment == 1);
}

void PredecessorRelaxation::Restart(WireState& state) {
  state.UntwistFrames(model_);
  physical_.Restart(state);
  mechanics_.points().Forget();
  mechanics_.BuildGradient(state, current_);
  up_to_date_ = true;
}

void PredecessorRelaxation::CopyFrom(const Relaxation& twin, const WireState& /*state*/) {
  const auto& from = dynamic_cast<const PredecessorRelaxation&>(twin);
  mechanics_.points().CopyFrom(from.mechanics_.points());
  physical_.CopyFrom(from.physical_);
  cycled_ = from.cycled_;
  up_to_date_ = from.up_to_date_;
  updates_before_ = from.updates_before_;
  current_ = from.current_;
}

void PredecessorRelaxation::Cycle(WireState& state) {
  physical_.Restart(state);
  physical_.ContinueCycle(std::numeric_limits<std::int64_t>::max(), state);
  cycled_ = true;
  up_to_date_ = false;
}

bool PredecessorRelaxation::Arrived(const InstrumentPoses& goal, const WireState& state) const {
  return state.poses() == goal;
}

void PredecessorRelaxation::Begin(WireState& /*state*/) {
  cycled_ = false;
  updates_before_ = physical_.updates();
}

int PredecessorRelaxation::Move(const InstrumentPoses& goal, WireState& state) {
  const InstrumentPoses next = stack().Towards(
      goal, state.poses(), settings_.feed_segments * model_.segment_mm(), settings_.max_turn_rad);
  // A feed at the base pushes the wire forward as it lies.
  if (next.reach_mm() != state.insertion_mm()) state.FeedAtBase(model_, next.reach_mm());
  if (next[0].rotation_rad != state.rotation_rad()) state.Rotate(next[0].rotation_rad);
  up_to_date_ = false;
  if (state.segments() > 0) Cycle(state);
  return 1;
}

bool PredecessorRelaxation::AtRest(WireState& state) {
  return cycled_ || !up_to_date_ || state.segments() == 0 ||
         current_.residual <= settings_.tolerance;
}

void PredecessorRelaxation::Relax(WireState& state, TickReport& report) {
  Cycle(state);
  ++report.iterations;
}

void PredecessorRelaxation::End(const WireState& state, bool /*settled*/, TickReport& report) {
  if (!up_to_date_) mechanics_.BuildGradient(state, current_);
  up_to_date_ = true;
  report.updates = physical_.updates() - updates_before_;
  report.converged = current_.residual <= settings_.tolerance;
  report.residual = current_.residual;
  report.max_penetration_mm = current_.max_penetration_mm;
}

}  // namespace torquer
