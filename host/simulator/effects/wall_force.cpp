#include "host/simulator/effects/wall_force.h"

#include <algorithm>

namespace torquer::effects {

void WallForce::Restart() {
  largest_mN_ = sum_mN_ = tip_mN_ = peak_mN_ = impulse_mNs_ = seconds_above_ = event_mN_ = 0;
  event_began_s_ = -1;
  events_ = 0;
}

void WallForce::Observe(const TickView& tick) {
  const bool above_before = largest_mN_ > threshold_mN_;
  largest_mN_ = sum_mN_ = tip_mN_ = 0;
  const Expansion& at = tick.expansion;
  const int per_segment = at.points.per_segment;
  const double segment_mm = at.points.size() == 0 ? 0 : per_segment * at.points.weight_mm.back();
  for (const int q : at.points.near) {
    const auto p = static_cast<std::size_t>(q);
    if (!at.points.touches[p]) continue;
    const ClearanceSample& sample = at.points.clearance[p];
    const double force_mN = 1e3 * at.points.stiffness_N_mm2[p] * at.points.weight_mm[p] *
                            (at.points.radius_mm[p] - sample.clearance_mm) * sample.gradient.norm();
    largest_mN_ = std::max(largest_mN_, force_mN);
    sum_mN_ += force_mN;
    if (segment_mm * at.points.FromTip(q) / per_segment <= tip_mm_) tip_mN_ += force_mN;
  }
  peak_mN_ = std::max(peak_mN_, largest_mN_);
  impulse_mNs_ += sum_mN_ * tick.step_s;
  if (largest_mN_ > threshold_mN_) {
    seconds_above_ += tick.step_s;
    if (!above_before) {
      ++events_;
      event_began_s_ = tick.time_s;
      event_mN_ = 0;
    }
    event_mN_ = std::max(event_mN_, largest_mN_);
  }
}

std::vector<Reading> WallForce::Readings() const {
  return {
      {"wall_force_largest_mN", largest_mN_},   {"wall_force_sum_mN", sum_mN_},
      {"wall_force_tip_mN", tip_mN_},           {"wall_force_largest_ever_mN", peak_mN_},
      {"wall_force_impulse_mNs", impulse_mNs_}, {"wall_force_events", static_cast<double>(events_)},
      {"wall_force_above_s", seconds_above_},   {"wall_force_event_s", event_began_s_},
      {"wall_force_event_mN", event_mN_}};
}

EffectKind WallForceKind() {
  static const Key kThreshold = {"threshold_mN", "mN",
                                 0.01,           1e5,
                                 std::nullopt,   "force of one contact that counts as an event"};
  static const Key kTip = {"tip_mm", "mm", 0,
                           300,      5,    "contacts this near to the distal end are the tip's"};
  return {.name = "wall_force",
          .summary = "force on the wall: largest, summed, at the tip, and events above a threshold",
          .roles = "observer",
          .keys = {kThreshold, kTip},
          .other_keys = {},
          .needs = "",
          .make = [](StrictTable& keys, const EffectContext&) -> std::unique_ptr<Effect> {
            const double threshold_mN = kThreshold.Read(keys);
            return std::make_unique<WallForce>(threshold_mN, kTip.Read(keys));
          }};
}

}  // namespace torquer::effects
