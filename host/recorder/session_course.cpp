#include "host/recorder/session_course.h"

#include <algorithm>
#include <cmath>

#include "host/support/angle.h"
#include "protocol/lcm_channels.h"

namespace torquer {
namespace {

// There are no ticks at rest. A longer time than this between consecutive ticks counts as rest.
constexpr double kRestS = 0.05;
constexpr double kTickS = 1e-3;
// Timeout after which the simulator treats the pedals as released (protocol/README.md).
constexpr double kSilentS = 0.3;

}  // namespace

void SessionCourse::Add(const torquer_lcm::instrument_command_t& command) {
  if (!last_ || last_->instruments.empty() || command.instrument != last_->instruments[0].name) {
    return;
  }
  // The clock gives the delay of a command after the newest tick. At rest this delay is long.
  double now_s = time_s_;
  if (command.clock_id == last_->clock_id && command.publish_us > last_->publish_us) {
    now_s +=
        1e-6 * (static_cast<double>(command.publish_us) - static_cast<double>(last_->publish_us));
  }
  ReleaseSilentPedals(now_s);
  xray_.Set(now_s, command.xray != 0);
  contrast_.Set(now_s, command.contrast != 0);
  command_s_ = now_s;
}

void SessionCourse::ReleaseSilentPedals(double now_s) {
  if (!command_s_ || now_s - *command_s_ <= kSilentS) return;
  xray_.Set(*command_s_ + kSilentS, false);
  contrast_.Set(*command_s_ + kSilentS, false);
}

void SessionCourse::Add(const torquer_lcm::wire_state_t& state) {
  if (!(std::abs(state.time_s) <= Series::kMost)) return;
  const Tick tick{state.tick, state.clock_id, state.publish_us,
                  (state.status & protocol::kWireConverged) != 0, state.instruments};
  if (!last_) begin_s_ = time_s_ = state.time_s;
  // Values stayed constant during rest. Without this extra point the plot would show a slow ramp.
  const bool follows = last_ && last_->number < INT64_MAX && tick.number == last_->number + 1;
  if (follows && state.time_s - time_s_ > kRestS) AddAt(state.time_s - kTickS, *last_);
  ReleaseSilentPedals(state.time_s);
  AddAt(state.time_s, tick);
  CountTick(state);
  last_ = tick;
}

void SessionCourse::AddAt(double time_s, const Tick& tick) {
  const double step_s = std::max(0.0, time_s - time_s_);
  time_s_ = std::max(time_s_, time_s);
  const std::size_t count = std::min(tick.instruments.size(), kMostInstruments);
  for (std::size_t k = 0; k < count; ++k) {
    const torquer_lcm::instrument_state_t& instrument = tick.instruments[k];
    if (k == instruments_.size()) instruments_.emplace_back().name = instrument.name;
    instruments_[k].insertion_mm.Add(time_s_, instrument.insertion_mm);
    instruments_[k].rotation_deg.Add(time_s_, kDegreesPerRad * instrument.rotation_rad);
    CountReversals(k, instrument.insertion_mm);
  }
  FollowHands(std::min(step_s, kRestS), tick);
  if (count > 0) FollowTip(time_s_, Eigen::Vector3d(tick.instruments[0].tip_mm));
}

void SessionCourse::FollowHands(double step_s, const Tick& tick) {
  bool moved = false;
  for (std::size_t k = 0; k < std::min(tick.instruments.size(), kMostInstruments); ++k) {
    const double mm = tick.instruments[k].insertion_mm;
    const double rad = tick.instruments[k].rotation_rad;
    if (!(std::abs(mm) <= Series::kMost) || !(std::abs(rad) <= Series::kMost)) continue;
    if (!hands_[k]) hands_[k] = {mm, rad, mm, rad};
    HandPoses& hand = *hands_[k];
    moved = moved || mm != hand.now_mm || rad != hand.now_rad;
    if (!xray_.on()) blind_.path_mm += std::abs(mm - hand.now_mm);
    hand.now_mm = mm;
    hand.now_rad = rad;
    const bool first = std::abs(mm - hand.start_mm) > kFirstMotionMm ||
                       std::abs(rad - hand.start_rad) > kFirstTurnRad;
    if (first && !first_motion_s_) first_motion_s_ = time_s_;
  }
  if (moved && !xray_.on()) blind_.time_s += step_s;
}

void SessionCourse::FollowTip(double time_s, const Eigen::Vector3d& tip_mm) {
  if (!tip_mm.allFinite()) return;
  if (!path_from_mm_) {
    path_from_mm_ = speed_from_mm_ = tip_mm;
    speed_from_s_ = time_s;
    KeepWay(tip_mm);
  }
  const double moved_mm = (tip_mm - *path_from_mm_).norm();
  if (moved_mm >= kPathStepMm) {
    tip_path_mm_ += moved_mm;
    path_from_mm_ = tip_mm;
    KeepWay(tip_mm);
  }
  const double window_s = time_s - speed_from_s_;
  if (window_s < kSpeedWindowS) return;
  const double way_mm = (tip_mm - *speed_from_mm_).norm();
  const double speed_mm_s = way_mm / window_s;
  tip_speed_mm_s_.Add(time_s, speed_mm_s);
  peak_speed_mm_s_ = std::max(peak_speed_mm_s_, speed_mm_s);
  if (speed_mm_s > kRestingMmS) {
    moving_mm_ += way_mm;
    moving_s_ += window_s;
  }
  speed_from_mm_ = tip_mm;
  speed_from_s_ = time_s;
}

void SessionCourse::KeepWay(const Eigen::Vector3d& tip_mm) {
  if (!tip_way_mm_.empty() && (tip_mm - tip_way_mm_.back()).norm() < way_step_mm_) return;
  if (tip_way_mm_.size() == kMostPathPoints) {
    way_step_mm_ *= 2;
    for (std::size_t i = 0; i < kMostPathPoints / 2; ++i) tip_way_mm_[i] = tip_way_mm_[2 * i];
    tip_way_mm_.resize(kMostPathPoints / 2);
  }
  tip_way_mm_.push_back(tip_mm);
}

void SessionCourse::CountReversals(std::size_t instrument, double insertion_mm) {
  if (!std::isfinite(insertion_mm)) return;
  Turn& turn = turns_[instrument];
  if (!turn.extreme_mm) turn.extreme_mm = insertion_mm;
  const double moved_mm = insertion_mm - *turn.extreme_mm;
  if (turn.direction != 0 && turn.direction * moved_mm >= 0) {
    turn.extreme_mm = insertion_mm;
  } else if (std::abs(moved_mm) > kReversalMm) {
    instruments_[instrument].reversals += turn.direction != 0 ? 1 : 0;
    turn.direction = moved_mm > 0 ? 1 : -1;
    turn.extreme_mm = insertion_mm;
  }
}

void SessionCourse::CountTick(const torquer_lcm::wire_state_t& state) {
  const auto has = [&state](protocol::WireStatus bit) { return (state.status & bit) != 0; };
  const bool converged = has(protocol::kWireConverged);
  ++solver_.ticks;
  solver_.unconverged += converged ? 0 : 1;
  solver_.budget_spent += !converged && has(protocol::kWireBudgetSpent) ? 1 : 0;
  solver_.stalled += !converged && has(protocol::kWireStalled) ? 1 : 0;
  solver_.outside += has(protocol::kWireOutsideLumen) ? 1 : 0;
  solver_.left_model += has(protocol::kWireLeftModel) ? 1 : 0;
  solver_.snapped += has(protocol::kWireSnapped) ? 1 : 0;
  solver_.in_doubt += has(protocol::kWireInDoubt) ? 1 : 0;
  if (converged && std::isfinite(state.residual)) {
    solver_.largest_residual = std::max(solver_.largest_residual.value_or(0), state.residual);
  }
}

// The readings describe the newest injection, until the next one begins.
void SessionCourse::AddInjection(const torquer_lcm::readings_t& readings) {
  const std::optional<double> start_s = FindReading(readings, "injection_start_s");
  if (!start_s) return;
  if (injections_.empty() || *start_s > injections_.back().start_s) {
    if (injections_.size() == kMostInjections) return;
    injections_.emplace_back().start_s = *start_s;
  }
  PowerInjection& newest = injections_.back();
  if (*start_s != newest.start_s) return;
  newest.volume_mL = FindReading(readings, "injection_set_mL").value_or(0);
  newest.rate_mL_s = FindReading(readings, "injection_rate_mL_s").value_or(0);
  newest.delivered_mL = FindReading(readings, "injection_mL").value_or(0);
  newest.aborted = FindReading(readings, "injection_aborted").value_or(0) == 1;
}

void SessionCourse::Add(const torquer_lcm::readings_t& readings) {
  AddInjection(readings);
  const std::optional<double> now = FindReading(readings, "wall_force_largest_mN");
  // A peak between two messages shows in the largest force so far.
  const double ever_mN =
      FindReading(readings, "wall_force_largest_ever_mN").value_or(wall_force_ever_mN_);
  const bool settled = now && last_ && readings.tick == last_->number && last_->converged;
  if (now && !settled) unsettled_force_mN_.Add(readings.time_s, *now);
  if (ever_mN > wall_force_ever_mN_) {
    wall_force_mN_.Add(readings.time_s, settled ? std::max(*now, ever_mN) : ever_mN);
  } else if (settled) {
    wall_force_mN_.Add(readings.time_s, *now);
  }
  wall_force_ever_mN_ = std::max(wall_force_ever_mN_, ever_mN);
}

}  // namespace torquer
