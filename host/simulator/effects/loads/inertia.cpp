#include "host/simulator/effects/loads/inertia.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "host/simulator/core/hash.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_sections.h"

namespace torquer::effects {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// 1 g/m in N s^2/mm^2 and 1 mPa s in N s/mm^2.
constexpr double kNewton = 1e-9;

// Length of a curve past the sheath, mm.
double Inserted(const PointSet& points) {
  if (points.size() == 0) return 0;
  return points.per_segment * points.first_spacing_mm +
         (points.size() - points.per_segment) * points.spacing_mm;
}

}  // namespace

Inertia::Inertia(Settings settings, const EffectContext& context)
    : settings_(std::move(settings)), stack_(context.stack) {
  const std::size_t points = static_cast<std::size_t>(context.wire.max_segments() + 1) *
                             static_cast<std::size_t>(context.wall.points_per_segment);
  next_.resize(points);
  const int curves = context.stack == nullptr ? 1 : context.stack->curves();
  for (int c = 0; c < curves; ++c) {
    Curve& curve = curves_.emplace_back();
    curve.sheath = (context.stack == nullptr ? context.wire : context.stack->empty_rod(c)).sheath();
    curve.material.resize(points);
  }
}

// Mean squared radius of a curve over the length of a point. At each place it is that of the
// outermost instrument there. A point's radius is a mean too, but its square is not.
double Inertia::SquaredRadius(const PointSet& points, int q) const {
  const int from_tip = points.FromTip(q) / points.per_segment * points.per_segment;
  double covered = 0;
  double squared_mm2 = 0;
  for (int k = points.instruments.last - 1; k >= points.instruments.first; --k) {
    const double coverage = points.CoverageOf(k, q);
    if (coverage <= covered) continue;
    const double from_tip_mm = from_tip * points.spacing_mm - points.instruments.behind_mm[k];
    const double radius_mm =
        SectionAt(stack_->instrument(k).sections(), std::max(0.0, from_tip_mm)).radius_mm;
    squared_mm2 += (coverage - covered) * radius_mm * radius_mm;
    covered = coverage;
  }
  return squared_mm2;
}

// Mass per length for motion across the wire. It includes the instruments, the fluid in them, and a
// cylinder's added mass: as much outer fluid as displaced. The instruments' densities are reduced
// by their displacement. So the fluid counts twice the volume that the outermost displaces. An
// instrument in a lumen with room has the fluid mass that it would have alone.
double Inertia::DensityAt(const PointSet& points, int q) const {
  double density_g_m = 0;
  const bool several = points.instruments.last - points.instruments.first > 1;
  for (int k = points.instruments.first; k < points.instruments.last; ++k) {
    const double coverage = several ? points.CoverageOf(k, q) : 1;
    density_g_m += coverage * settings_.linear_density_g_m[static_cast<std::size_t>(k)];
  }
  const auto p = static_cast<std::size_t>(q);
  double squared_mm2 =
      several ? SquaredRadius(points, q) : points.radius_mm[p] * points.radius_mm[p];
  if (!points.among.inside_mm2.empty()) squared_mm2 -= points.among.inside_mm2[p];
  return density_g_m + 2e-3 * settings_.fluid_kg_m3 * std::numbers::pi * squared_mm2;
}

Inertia::Material Inertia::Before(const PointSet& points, int q) const {
  const Curve& curve = CurveOf(points);
  // Points in the first segment do not keep their material, because its length changes.
  const bool keeps = q + 1 >= points.per_segment;
  if (keeps && points.FromTip(q) < curve.known) {
    return curve.material[static_cast<std::size_t>(points.FromTip(q))];
  }
  const double from_tip_mm = keeps ? points.FromTip(q) * points.spacing_mm
                                   : Inserted(points) - (q + 1) * points.first_spacing_mm;
  const double in_sheath_mm = from_tip_mm - curve.inserted_mm;
  const Sheath& sheath = curve.sheath;
  Material in_sheath{sheath.point_mm - std::max(0.0, in_sheath_mm) * sheath.direction,
                     curve.fed_mm_s * sheath.direction};
  if (in_sheath_mm >= 0 || curve.known == 0) return in_sheath;
  // A place on the former first segment: interpolated from its end to the sheath.
  const Material& end = curve.material[static_cast<std::size_t>(curve.known - 1)];
  const double length_mm = curve.inserted_mm - (curve.known - 1) * points.spacing_mm;
  const double fraction = std::clamp(-in_sheath_mm / length_mm, 0.0, 1.0);
  return {in_sheath.at + fraction * (end.at - in_sheath.at),
          in_sheath.velocity_mm_s + fraction * (end.velocity_mm_s - in_sheath.velocity_mm_s)};
}

void Inertia::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Inertia&>(twin);
  curves_ = from.curves_;
  left_s_ = from.left_s_;
  part_s_ = from.part_s_;
  kinetic_mJ_ = from.kinetic_mJ_;
}

// Stores the length of a curve past the sheath, and the points that keep their material.
void Inertia::Remember(const PointSet& points, Curve& curve) {
  curve.known = std::max(0, points.size() - points.per_segment + 1);
  curve.inserted_mm = Inserted(points);
}

void Inertia::Begin(const PointSet& points) {
  part_s_ = left_s_;
  Curve& curve = curves_[static_cast<std::size_t>(points.among.curve)];
  if (curve.begun) return;
  curve.begun = true;
  for (int q = points.per_segment - 1; q < points.size(); ++q) {
    curve.material[static_cast<std::size_t>(points.FromTip(q))] = {
        points.position[static_cast<std::size_t>(q)], Vector3d::Zero()};
  }
  Remember(points, curve);
}

double Inertia::Add(const PointSet& points, PointDerivatives& out) const {
  if (part_s_ == 0) return 0;  // without elapsed time the wire goes to its equilibrium
  double energy = 0;
  for (int q = 0; q < points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    const Material before = Before(points, q);
    const double length_mm = points.weight_mm[p];
    const double mass = kNewton * DensityAt(points, q) * length_mm / (part_s_ * part_s_);
    // An instrument in a lumen has no drag, because no blood surrounds it.
    const double drag_mPa_s = q < points.among.in_lumen ? 0 : settings_.drag_mPa_s;
    const double drag = kNewton * drag_mPa_s * length_mm / part_s_;
    const Vector3d moved = points.position[p] - before.at;
    const Vector3d ahead = moved - part_s_ * before.velocity_mm_s;
    energy += mass * ahead.squaredNorm() / 2 + drag * moved.squaredNorm() / 2;
    out.Touch(q);
    out.gradient[p] += mass * ahead + drag * moved;
    if (out.with_hessian) out.hessian[p] += (mass + drag) * Matrix3d::Identity();
  }
  return energy;
}

void Inertia::End(const PointSet& points) {
  const double per_s = part_s_ > 0 ? 1 / part_s_ : 0;
  if (points.among.curve == 0) kinetic_mJ_ = 0;
  Curve& curve = curves_[static_cast<std::size_t>(points.among.curve)];
  for (int q = 0; q < points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    const Vector3d& at = points.position[p];
    const Vector3d velocity_mm_s = per_s * (at - Before(points, q).at);
    kinetic_mJ_ +=
        kNewton * DensityAt(points, q) * points.weight_mm[p] * velocity_mm_s.squaredNorm() / 2;
    if (q + 1 < points.per_segment) continue;
    next_[static_cast<std::size_t>(points.FromTip(q))] = {at, velocity_mm_s};
  }
  const double before_mm = curve.inserted_mm;
  std::swap(curve.material, next_);
  Remember(points, curve);
  curve.fed_mm_s = per_s * (curve.inserted_mm - before_mm);
  if (static_cast<std::size_t>(points.among.curve) + 1 < curves_.size()) return;
  left_s_ -= part_s_;
  part_s_ = 0;
}

void Inertia::Reset() {
  for (Curve& curve : curves_) {
    curve.begun = false;
    curve.known = 0;
    curve.inserted_mm = curve.fed_mm_s = 0;
  }
  left_s_ = part_s_ = kinetic_mJ_ = 0;
}

std::uint64_t Inertia::Hash(std::uint64_t seed) const {
  for (const double value : {left_s_, part_s_}) seed = HashDouble(value, seed);
  for (const Curve& curve : curves_) {
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
                  "velocity. The default holds for a thin rod of 200 diameters at 3.5 mPa s: 4 pi "
                  "viscosity / (ln(length / diameter) + 0.84). Source: Tirado and Garcia de la "
                  "Torre, J Chem Phys 1979;71:2581")
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
    spec.origin.Refuse(
        "drag_mPa_s",
        "no instrument has a mass; set linear_density_g_m of an instrument above 0, or "
        "remove [effects.inertia]");
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
