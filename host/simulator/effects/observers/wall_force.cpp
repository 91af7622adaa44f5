#include "host/simulator/effects/observers/wall_force.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace torquer::effects {

void WallForce::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const WallForce&>(twin);
  largest_mN_ = from.largest_mN_;
  sum_mN_ = from.sum_mN_;
  tip_mN_ = from.tip_mN_;
  pressure_kPa_ = from.pressure_kPa_;
  tip_pressure_kPa_ = from.tip_pressure_kPa_;
  tip_pressure_peak_kPa_ = from.tip_pressure_peak_kPa_;
  peak_mN_ = from.peak_mN_;
  impulse_mNs_ = from.impulse_mNs_;
  knows_forces_ = from.knows_forces_;
  any_converged_ = from.any_converged_;
  missed_any_ = from.missed_any_;
  above_ = from.above_;
  events_ = from.events_;
  unconverged_s_ = from.unconverged_s_;
  seconds_above_ = from.seconds_above_;
  event_began_s_ = from.event_began_s_;
  event_mN_ = from.event_mN_;
}

void WallForce::Restart() {
  largest_mN_ = sum_mN_ = tip_mN_ = pressure_kPa_ = tip_pressure_kPa_ = 0;
  peak_mN_ = tip_pressure_peak_kPa_ = impulse_mNs_ = seconds_above_ = event_mN_ = 0;
  unconverged_s_ = event_began_s_ = 0;
  events_ = 0;
  above_ = any_converged_ = knows_forces_ = missed_any_ = false;
}

// Adds a contact. Its point stands for the wire between the middles of the pieces beyond it and
// before it.
void WallForce::AddContact(const PointSet& points, int q, Contacts& contacts) {
  const auto p = static_cast<std::size_t>(q);
  const ClearanceSample& sample = points.clearance[p];
  const double depth_mm = points.radius_mm[p] - sample.clearance_mm;
  const double length_mm = points.weight_mm[p];
  const double force_mN =
      1e3 * points.stiffness_N_mm2[p] * length_mm * depth_mm * sample.gradient.norm();
  const double beyond_mm =
      q + 1 < points.size() ? points.FromTipMm(q) - points.FromTipMm(q + 1) : 0;
  const double begin_mm = points.among.behind_farthest_mm + points.FromTipMm(q) - beyond_mm / 2;
  contacts.force_mN.Add(begin_mm, begin_mm + length_mm, force_mN);
  sum_mN_ += force_mN;
  contacts.depth_mm2.Add(begin_mm, begin_mm + length_mm, depth_mm * length_mm);
  contacts.radius_mm_mN.Add(begin_mm, begin_mm + length_mm, points.radius_mm[p] * force_mN);
  // The clearance decreases towards the wall, so the wire is pushed along its gradient.
  const double along = -sample.gradient.normalized().dot(points.Tangent(q));
  if (begin_mm - contacts.behind_mm < settings_.patch_mm) {
    contacts.axial_mN += std::max(0.0, along) * force_mN;
  }
}

// Uses the mean depth of the whole patch. The depth of a single point grows without bound as the
// segments get shorter.
double WallForce::PressureOn(const Contacts& contacts, const SpreadAlong::Stretch& patch) const {
  if (patch.amount == 0) return 0;
  const double end_mm = patch.begin_mm + settings_.patch_mm;
  const double radius_mm = contacts.radius_mm_mN.Between(patch.begin_mm, end_mm) / patch.amount;
  const double depth_mm =
      std::min(radius_mm, contacts.depth_mm2.Between(patch.begin_mm, end_mm) / settings_.patch_mm);
  const double width_mm = 2 * std::sqrt(depth_mm * (2 * radius_mm - depth_mm));
  return patch.amount / settings_.patch_mm / width_mm;
}

void WallForce::Contacts::Clear() {
  force_mN.Clear();
  depth_mm2.Clear();
  radius_mm_mN.Clear();
  axial_mN = 0;
  behind_mm = std::numeric_limits<double>::infinity();
  end_radius_mm = 1;
}

double WallForce::Contacts::TipPressureKPa() const {
  return axial_mN / (std::numbers::pi * end_radius_mm * end_radius_mm);
}

// Finds the farthest tip of the curves within each other, and that of those beside them.
void WallForce::FindTips(const TickView& tick) {
  for (int c = 0; c < tick.state.curves(); ++c) {
    const PointSet& points = tick.quadratic.curve(c).points;
    Contacts& contacts = points.among.beside_farthest ? beside_contacts_ : contacts_;
    if (points.size() == 0 || points.among.behind_farthest_mm >= contacts.behind_mm) continue;
    contacts.behind_mm = points.among.behind_farthest_mm;
    contacts.end_radius_mm = points.radius_mm.back();
  }
}

void WallForce::FindForces(const TickView& tick) {
  contacts_.Clear();
  beside_contacts_.Clear();
  sum_mN_ = 0;
  FindTips(tick);
  // From the outermost curve inwards: an inner one touches the wall only beyond its mouth.
  for (int c = tick.state.curves() - 1; c >= 0; --c) {
    const PointSet& of_curve = tick.quadratic.curve(c).points;
    for (const int q : of_curve.near) {
      if (!of_curve.touches[static_cast<std::size_t>(q)]) continue;
      AddContact(of_curve, q, of_curve.among.beside_farthest ? beside_contacts_ : contacts_);
    }
  }
  const SpreadAlong::Stretch patch = contacts_.force_mN.LargestOn(settings_.patch_mm);
  const SpreadAlong::Stretch beside = beside_contacts_.force_mN.LargestOn(settings_.patch_mm);
  largest_mN_ = std::max(patch.amount, beside.amount);
  pressure_kPa_ = beside.amount > patch.amount ? PressureOn(beside_contacts_, beside)
                                               : PressureOn(contacts_, patch);
  const double beside_mm = beside_contacts_.behind_mm;
  tip_mN_ = std::max(contacts_.force_mN.Between(0, settings_.tip_mm),
                     beside_contacts_.force_mN.Between(beside_mm, beside_mm + settings_.tip_mm));
  tip_pressure_kPa_ = std::max(contacts_.TipPressureKPa(), beside_contacts_.TipPressureKPa());
}

void WallForce::Observe(const TickView& tick) {
  FindForces(tick);
  knows_forces_ = tick.KnowsForces();
  missed_any_ = missed_any_ || !knows_forces_;
  if (!tick.report.converged) {
    unconverged_s_ += tick.step_s;
    return;
  }
  any_converged_ = true;
  peak_mN_ = std::max(peak_mN_, largest_mN_);
  tip_pressure_peak_kPa_ = std::max(tip_pressure_peak_kPa_, tip_pressure_kPa_);
  impulse_mNs_ += sum_mN_ * tick.step_s;
  const bool above_before = std::exchange(above_, largest_mN_ > settings_.threshold_mN);
  if (!above_) return;
  seconds_above_ += tick.step_s;
  if (!above_before) {
    ++events_;
    event_began_s_ = tick.time_s;
    event_mN_ = 0;
  }
  event_mN_ = std::max(event_mN_, largest_mN_);
}

std::vector<Reading> WallForce::Readings() const {
  return {{"wall_force_largest_mN", largest_mN()},
          {"wall_force_sum_mN", sum_mN()},
          {"wall_force_tip_mN", tip_mN()},
          {"wall_line_load_mN_mm", line_load_mN_mm()},
          {"wall_pressure_kPa", pressure_kPa()},
          {"wall_tip_pressure_kPa", tip_pressure_kPa()},
          {"wall_force_largest_ever_mN", largest_ever_mN()},
          {"wall_tip_pressure_ever_kPa", tip_pressure_ever_kPa()},
          {"wall_force_impulse_mNs", impulse_mNs()},
          {"wall_force_events", Counted(events_)},
          {"wall_force_above_s", Counted(seconds_above_)},
          {"wall_force_event_s", event_began_s()},
          {"wall_force_event_mN", event_mN()},
          {"wall_force_unconverged_s", unconverged_s_}};
}

namespace {

struct WallForceSpec : TableSpec {
  double threshold_mN = 0;
  double tip_mm = 5;
  double patch_mm = 2;
};

const Keys<WallForceSpec>& WallForceKeys() {
  static const Keys<WallForceSpec> keys =
      Keys<WallForceSpec>()
          .Required()
          .Number("threshold_mN", &WallForceSpec::threshold_mN, 0.01, 1e5, "mN",
                  "force on a patch of the wall above which an event is counted")
          .Number("tip_mm", &WallForceSpec::tip_mm, 0, 300, "mm",
                  "length of the distal part that counts as the tip")
          .Number("patch_mm", &WallForceSpec::patch_mm, 0.1, 50, "mm",
                  "length of a patch, along which contact forces are summed; at least one segment")
          .Example("threshold_mN = 30\n");
  return keys;
}

std::unique_ptr<Effect> MakeWallForce(const WallForceSpec& spec, const EffectContext& context) {
  if (spec.patch_mm < context.wire.segment_mm()) {
    spec.origin.Refuse("patch_mm", fmt::format("must be at least the length of a segment, {:g} mm",
                                               context.wire.segment_mm()));
  }
  return std::make_unique<WallForce>(WallForce::Settings{
      .threshold_mN = spec.threshold_mN, .tip_mm = spec.tip_mm, .patch_mm = spec.patch_mm});
}

}  // namespace

EffectKind WallForceKind() {
  return {.name = "wall_force",
          .summary =
              "force and pressure on the wall: largest, total and at the tip, with events above a "
              "threshold",
          .roles = "observer",
          .keys = Any(WallForceKeys()),
          .make = MakeWith(MakeWallForce)};
}

}  // namespace torquer::effects
