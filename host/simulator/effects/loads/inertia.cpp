#include "host/simulator/effects/loads/inertia.h"

#include <algorithm>
#include <numbers>
#include <utility>

#include "host/simulator/core/hash.h"

namespace torquer::effects {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// 1 g/m in N s^2/mm^2 and 1 mPa s in N s/mm^2.
constexpr double kNewton = 1e-9;

double Inserted(const PointSet& points) {
  if (points.size() == 0) return 0;
  return points.per_segment * points.first_spacing_mm +
         (points.size() - points.per_segment) * points.spacing_mm;
}

}  // namespace

Inertia::Inertia(Settings settings, const EffectContext& context)
    : settings_(std::move(settings)),
      sheath_(context.wire.sheath()),
      material_(static_cast<std::size_t>(context.wire.max_segments() + 1) *
                static_cast<std::size_t>(context.wall.points_per_segment)) {}

// What moves across: the instruments, the fluid in them, and outside them as much as they displace,
// which is the added mass of a cylinder. Of the fluid that is twice what the outermost displaces,
// because the instruments' own densities are less what each displaces.
double Inertia::DensityAt(const PointSet& points, int q) const {
  double density_g_m = 0;
  for (int k = 0; k < points.instruments; ++k) {
    if (points.instruments > 1 && points.FromTipOf(k, q) < 0) continue;
    density_g_m += settings_.linear_density_g_m[static_cast<std::size_t>(k)];
  }
  const double radius_mm = points.radius_mm[static_cast<std::size_t>(q)];
  return density_g_m + 2e-3 * settings_.fluid_kg_m3 * std::numbers::pi * radius_mm * radius_mm;
}

Inertia::Material Inertia::Before(const PointSet& points, int q) const {
  // Within the first segment, whose length changes, points do not keep their material.
  const bool keeps = q + 1 >= points.per_segment;
  if (keeps && points.FromTip(q) < known_) {
    return material_[static_cast<std::size_t>(points.FromTip(q))];
  }
  const double from_tip_mm = keeps ? points.FromTip(q) * points.spacing_mm
                                   : Inserted(points) - (q + 1) * points.first_spacing_mm;
  const double in_sheath_mm = from_tip_mm - inserted_mm_;
  Material in_sheath{sheath_.point_mm - std::max(0.0, in_sheath_mm) * sheath_.direction,
                     fed_mm_s_ * sheath_.direction};
  if (in_sheath_mm >= 0 || known_ == 0) return in_sheath;
  // On the first segment as it was: straight, from its end to the sheath.
  const Material& end = material_[static_cast<std::size_t>(known_ - 1)];
  const double length_mm = inserted_mm_ - (known_ - 1) * points.spacing_mm;
  const double part = std::clamp(-in_sheath_mm / length_mm, 0.0, 1.0);
  return {in_sheath.at + part * (end.at - in_sheath.at),
          in_sheath.velocity_mm_s + part * (end.velocity_mm_s - in_sheath.velocity_mm_s)};
}

void Inertia::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Inertia&>(twin);
  material_ = from.material_;
  known_ = from.known_;
  inserted_mm_ = from.inserted_mm_;
  fed_mm_s_ = from.fed_mm_s_;
  begun_ = from.begun_;
  left_s_ = from.left_s_;
  part_s_ = from.part_s_;
  kinetic_mJ_ = from.kinetic_mJ_;
}

void Inertia::Begin(const PointSet& points) {
  part_s_ = left_s_;
  if (begun_) return;
  begun_ = true;
  for (int q = points.per_segment - 1; q < points.size(); ++q) {
    material_[static_cast<std::size_t>(points.FromTip(q))] = {
        points.position[static_cast<std::size_t>(q)], Vector3d::Zero()};
  }
  known_ = std::max(0, points.size() - points.per_segment + 1);
  inserted_mm_ = Inserted(points);
}

double Inertia::Add(const PointSet& points, PointDerivatives& out) const {
  if (part_s_ == 0) return 0;  // in no time the wire goes to where it rests
  double energy = 0;
  for (int q = 0; q < points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    const Material before = Before(points, q);
    const double length_mm = points.weight_mm[static_cast<std::size_t>(q)];
    const double mass = kNewton * DensityAt(points, q) * length_mm / (part_s_ * part_s_);
    const double drag = kNewton * settings_.drag_mPa_s * length_mm / part_s_;
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
  kinetic_mJ_ = 0;
  // From the sheath on: what is not known yet is between the last that is and the sheath.
  for (int q = 0; q < points.size(); ++q) {
    const Vector3d& at = points.position[static_cast<std::size_t>(q)];
    const Vector3d velocity_mm_s = per_s * (at - Before(points, q).at);
    kinetic_mJ_ += kNewton * DensityAt(points, q) * points.weight_mm[static_cast<std::size_t>(q)] *
                   velocity_mm_s.squaredNorm() / 2;
    if (q + 1 < points.per_segment) continue;
    material_[static_cast<std::size_t>(points.FromTip(q))] = {at, velocity_mm_s};
  }
  known_ = std::max(0, points.size() - points.per_segment + 1);
  const double inserted_mm = Inserted(points);
  fed_mm_s_ = per_s * (inserted_mm - inserted_mm_);
  inserted_mm_ = inserted_mm;
  left_s_ -= part_s_;
  part_s_ = 0;
}

void Inertia::Reset() {
  begun_ = false;
  known_ = 0;
  inserted_mm_ = fed_mm_s_ = left_s_ = part_s_ = kinetic_mJ_ = 0;
}

std::uint64_t Inertia::Hash(std::uint64_t seed) const {
  for (const double value : {left_s_, part_s_, inserted_mm_, fed_mm_s_}) {
    seed = HashDouble(value, seed);
  }
  for (int j = 0; j < known_; ++j) {
    const Material& material = material_[static_cast<std::size_t>(j)];
    for (const double component : material.at) seed = HashDouble(component, seed);
    for (const double component : material.velocity_mm_s) seed = HashDouble(component, seed);
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
                  "force of the blood on the instruments per length and velocity; 4 pi viscosity / "
                  "(ln(length / diameter) + 0.84) across a thin rod, with 3.5 mPa s and 200 "
                  "diameters 7 (Tirado and Garcia de la Torre, J Chem Phys 1979;71:2581)")
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
              "the mass of the instruments (their linear_density_g_m) and the drag of the "
              "blood: snaps take time",
          .roles = "energy term, timed, observer",
          .keys = Any(InertiaKeys()),
          .make = MakeWith(MakeInertia)};
}

}  // namespace torquer::effects
