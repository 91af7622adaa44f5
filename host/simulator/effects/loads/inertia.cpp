#include "host/simulator/effects/loads/inertia.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "host/simulator/core/hash.h"

namespace torquer::effects {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// 1 g/m in N s^2/mm^2 and 1 mPa s in N s/mm^2.
constexpr double kNewton = 1e-9;

// Length of a curve past the sheath, mm.
double Inserted(const PointSet& points, double behind_mm) {
  if (points.size() == 0) return 0;
  return points.per_segment * points.first_spacing_mm +
         (points.size() - points.per_segment) * points.spacing_mm - behind_mm;
}

// Distance of a curve's tip behind the distal end, mm.
double BehindMm(const PointSet& points, bool second) {
  if (!second) return 0;
  double behind_mm = points.spacing_mm * points.size();
  for (int k = 0; k < points.instruments; ++k) {
    if (points.LiesOnSecond(k)) {
      behind_mm = std::min(behind_mm, points.behind_mm[static_cast<std::size_t>(k)]);
    }
  }
  return behind_mm;
}

// Calls each(second) for every curve.
template <class Each>
void ForCurves(const PointSet& points, Each each) {
  each(false);
  if (points.first_outer > 0) each(true);
}

}  // namespace

Inertia::Inertia(Settings settings, const EffectContext& context)
    : settings_(std::move(settings)), sheath_(context.wire.sheath()) {
  const std::size_t points = static_cast<std::size_t>(context.wire.max_segments() + 1) *
                             static_cast<std::size_t>(context.wall.points_per_segment);
  curves_[0].material.resize(points);
  next_.resize(points);
  if (context.stack != nullptr && context.stack->second_rod() != nullptr) {
    curves_[1].material.resize(points);
  }
}

std::size_t Inertia::NumberOf(const PointSet& points, bool second) {
  return points.first_outer > 0 && second != points.outer_leads ? 1 : 0;
}

// Mass per length for motion across the wire. It includes the instruments, the fluid in them, and
// the added mass of a cylinder: as much outer fluid as they displace. So the fluid counts twice the
// volume displaced by the outermost, because the instruments' own densities are reduced by their
// displacement. The inner of two curves has the fluid mass that it would have alone.
double Inertia::DensityAt(const PointSet& points, bool second, int q) const {
  double density_g_m = 0;
  for (int k = 0; k < points.instruments; ++k) {
    if (points.LiesOnSecond(k) != second) continue;
    const double part = points.instruments > 1 ? points.PartOf(k, q) : 1;
    density_g_m += part * settings_.linear_density_g_m[static_cast<std::size_t>(k)];
  }
  const auto p = static_cast<std::size_t>(q);
  const bool outer_seen = points.OnSecond(q) != points.outer_leads;
  const bool within = outer_seen && q < static_cast<int>(points.covered.size());
  double squared_mm2 = 0;
  if (points.OnSecond(q) == second) {
    squared_mm2 = points.radius_mm[p] * points.radius_mm[p];
    if (within) squared_mm2 -= points.covered_radius_mm[p] * points.covered_radius_mm[p];
  } else if (within) {
    squared_mm2 = points.covered_radius_mm[p] * points.covered_radius_mm[p];
  }
  return density_g_m + 2e-3 * settings_.fluid_kg_m3 * std::numbers::pi * squared_mm2;
}

Inertia::Seen Inertia::See(const PointSet& points, bool second) const {
  const Curve& curve = curves_[NumberOf(points, second)];
  const double behind_mm = BehindMm(points, second);
  const int last = points.SizeOf(second) - 1;
  const double beyond_tip_mm = behind_mm - points.FromTip(last) * points.spacing_mm;
  return {points, curve, last, behind_mm,
          (curve.beyond_tip_mm - beyond_tip_mm) / points.spacing_mm};
}

Inertia::Material Inertia::Before(const Seen& seen, int q) const {
  const PointSet& points = seen.points;
  const Curve& curve = seen.curve;
  // Points in the first segment do not keep their material, because its length changes.
  const bool keeps = q + 1 >= points.per_segment;
  if (keeps && seen.moved == 0 && seen.last - q < curve.known) {
    return curve.material[static_cast<std::size_t>(seen.last - q)];
  }
  const double place = seen.last - q + seen.moved;  // in pieces from the first stored entry
  if (keeps && place <= curve.known - 1) {
    const int at = std::clamp(static_cast<int>(std::floor(place)), 0, std::max(0, curve.known - 2));
    const Material& here = curve.material[static_cast<std::size_t>(at)];
    if (curve.known == 1) return here;
    const double part = place - at;
    const Material& next = curve.material[static_cast<std::size_t>(at) + 1];
    return {here.at + part * (next.at - here.at),
            here.velocity_mm_s + part * (next.velocity_mm_s - here.velocity_mm_s)};
  }
  const double from_tip_mm =
      keeps ? points.FromTip(q) * points.spacing_mm - seen.behind_mm
            : Inserted(points, seen.behind_mm) - (q + 1) * points.first_spacing_mm;
  const double in_sheath_mm = from_tip_mm - curve.inserted_mm;
  Material in_sheath{sheath_.point_mm - std::max(0.0, in_sheath_mm) * sheath_.direction,
                     curve.fed_mm_s * sheath_.direction};
  if (in_sheath_mm >= 0 || curve.known == 0) return in_sheath;
  // A place on the former first segment: interpolated from its end to the sheath.
  const Material& end = curve.material[static_cast<std::size_t>(curve.known - 1)];
  const double length_mm =
      curve.inserted_mm - ((curve.known - 1) * points.spacing_mm - curve.beyond_tip_mm);
  const double part = std::clamp(-in_sheath_mm / length_mm, 0.0, 1.0);
  return {in_sheath.at + part * (end.at - in_sheath.at),
          in_sheath.velocity_mm_s + part * (end.velocity_mm_s - in_sheath.velocity_mm_s)};
}

void Inertia::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Inertia&>(twin);
  curves_ = from.curves_;
  begun_ = from.begun_;
  left_s_ = from.left_s_;
  part_s_ = from.part_s_;
  kinetic_mJ_ = from.kinetic_mJ_;
}

// Stores the length of a curve past the sheath, and the points that keep their material.
void Inertia::Remember(const PointSet& points, bool second, Curve& curve) {
  const int count = points.SizeOf(second);
  const double behind_mm = BehindMm(points, second);
  curve.known = std::max(0, count - points.per_segment + 1);
  curve.beyond_tip_mm = count == 0 ? 0 : behind_mm - points.FromTip(count - 1) * points.spacing_mm;
  curve.inserted_mm = Inserted(points, behind_mm);
}

void Inertia::Begin(const PointSet& points) {
  part_s_ = left_s_;
  if (begun_) return;
  begun_ = true;
  ForCurves(points, [&](bool second) {
    Curve& curve = curves_[NumberOf(points, second)];
    const int count = points.SizeOf(second);
    for (int q = points.per_segment - 1; q < count; ++q) {
      curve.material[static_cast<std::size_t>(count - 1 - q)] = {points.PositionOn(second, q),
                                                                 Vector3d::Zero()};
    }
    Remember(points, second, curve);
  });
}

double Inertia::Add(const PointSet& points, PointDerivatives& out) const {
  if (part_s_ == 0) return 0;  // without elapsed time the wire goes to its equilibrium
  double energy = 0;
  ForCurves(points, [&](bool second) {
    const Seen seen = See(points, second);
    for (int q = 0; q <= seen.last; ++q) {
      const auto p = static_cast<std::size_t>(q);
      const Material before = Before(seen, q);
      const double length_mm = points.weight_mm[p];
      const double mass = kNewton * DensityAt(points, second, q) * length_mm / (part_s_ * part_s_);
      // An instrument in a lumen has no drag, because no blood surrounds it.
      const double drag_mPa_s = points.OnSecond(q) == second ? settings_.drag_mPa_s : 0;
      const double drag = kNewton * drag_mPa_s * length_mm / part_s_;
      const Vector3d moved = points.PositionOn(second, q) - before.at;
      const Vector3d ahead = moved - part_s_ * before.velocity_mm_s;
      energy += mass * ahead.squaredNorm() / 2 + drag * moved.squaredNorm() / 2;
      PositionDerivatives& on = out.On(points, second, q);
      on.Touch(q);
      on.gradient[p] += mass * ahead + drag * moved;
      if (on.with_hessian) on.hessian[p] += (mass + drag) * Matrix3d::Identity();
    }
  });
  return energy;
}

void Inertia::End(const PointSet& points) {
  const double per_s = part_s_ > 0 ? 1 / part_s_ : 0;
  kinetic_mJ_ = 0;
  ForCurves(points, [&](bool second) {
    Curve& curve = curves_[NumberOf(points, second)];
    const Seen seen = See(points, second);
    for (int q = 0; q <= seen.last; ++q) {
      const Vector3d& at = points.PositionOn(second, q);
      const Vector3d velocity_mm_s = per_s * (at - Before(seen, q).at);
      kinetic_mJ_ += kNewton * DensityAt(points, second, q) *
                     points.weight_mm[static_cast<std::size_t>(q)] * velocity_mm_s.squaredNorm() /
                     2;
      if (q + 1 < points.per_segment) continue;
      next_[static_cast<std::size_t>(seen.last - q)] = {at, velocity_mm_s};
    }
    const double before_mm = curve.inserted_mm;
    std::swap(curve.material, next_);
    Remember(points, second, curve);
    curve.fed_mm_s = per_s * (curve.inserted_mm - before_mm);
  });
  left_s_ -= part_s_;
  part_s_ = 0;
}

void Inertia::Reset() {
  begun_ = false;
  for (Curve& curve : curves_) {
    curve.known = 0;
    curve.beyond_tip_mm = curve.inserted_mm = curve.fed_mm_s = 0;
  }
  left_s_ = part_s_ = kinetic_mJ_ = 0;
}

std::uint64_t Inertia::Hash(std::uint64_t seed) const {
  for (const double value : {left_s_, part_s_}) seed = HashDouble(value, seed);
  for (const Curve& curve : curves_) {
    if (curve.material.empty()) continue;
    for (const double value : {curve.inserted_mm, curve.fed_mm_s}) seed = HashDouble(value, seed);
    for (int j = 0; j < curve.known; ++j) {
      const Material& material = curve.material[static_cast<std::size_t>(j)];
      for (const double component : material.at) seed = HashDouble(component, seed);
      for (const double component : material.velocity_mm_s) seed = HashDouble(component, seed);
    }
  }
  return seed;
}

namespace {

struct InertiaSpec : TableSpec {
  double drag_mPa_s = 7;
};

const Keys<InertiaSpec>& InertiaKeys() {
  static const Keys<InertiaSpec> keys =
      Keys<InertiaSpec>()
          .Number("drag_mPa_s", &InertiaSpec::drag_mPa_s, 0, 1e6, "mPa s",
                  "drag coefficient of the blood: transverse force on an instrument per length and "
                  "velocity. The default holds for a thin rod of 200 diameters at 3.5 mPa s, from "
                  "4 pi viscosity / (ln(length / diameter) + 0.84) (Tirado and Garcia de la Torre, "
                  "J Chem Phys 1979;71:2581)")
          .Example("drag_mPa_s = 7\n");
  return keys;
}

std::unique_ptr<Effect> MakeInertia(const InertiaSpec& spec, const EffectContext& context) {
  constexpr double kBloodKgM3 = 1060;
  Inertia::Settings settings;
  settings.fluid_kg_m3 = kBloodKgM3;
  settings.drag_mPa_s = spec.drag_mPa_s;
  bool any = false;
  for (const Instrument& instrument : context.instruments) {
    any = any || instrument.linear_density_g_m > 0;
    settings.linear_density_g_m.push_back(instrument.linear_density_g_m);
  }
  if (!any) {
    spec.origin.Refuse("drag_mPa_s",
                       "no instrument has a mass; give one its linear_density_g_m, or remove "
                       "[effects.inertia]");
  }
  return std::make_unique<Inertia>(std::move(settings), context);
}

}  // namespace

EffectKind InertiaKind() {
  return {.name = "inertia",
          .summary =
              "mass of the instruments, from their linear_density_g_m, and drag of the blood; they "
              "give a snap its duration",
          .roles = "energy term, timed, observer",
          .keys = Any(InertiaKeys()),
          .make = MakeWith(MakeInertia)};
}

}  // namespace torquer::effects
