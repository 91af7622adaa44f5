#include "host/simulator/effects/point_load.h"

#include <bit>
#include <cmath>
#include <numbers>

#include "host/simulator/effects/region_keys.h"
#include "host/simulator/vessel/smooth_step.h"

namespace torquer::effects {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// Sine of the angle to the axis below which the moment fades.
constexpr double kFade = 0.1;

// The angle of a direction about a unit axis.
double AngleAbout(const Vector3d& axis, const Vector3d& direction) {
  Eigen::Index smallest = 0;
  axis.cwiseAbs().minCoeff(&smallest);
  const Vector3d unit = Vector3d::Unit(smallest);
  const Vector3d first = (unit - unit.dot(axis) * axis).normalized();
  return std::atan2(axis.cross(first).dot(direction), first.dot(direction));
}

}  // namespace

void PointLoad::Begin(const PointSet& points) {
  if (load_.moment_mJ == 0 || points.size() == 0) return;
  const double angle = AngleAbout(load_.axis, points.Tangent(points.size() - 1));
  angle_rad_ += std::remainder(angle - angle_rad_, 2 * std::numbers::pi);
}

double PointLoad::Turn(const Vector3d& tangent, TangentLoad& out) const {
  const Vector3d across = tangent - tangent.dot(load_.axis) * load_.axis;
  const double rho = across.norm();
  if (rho < 1e-9) return 0;
  const Vector3d outward = across / rho;
  const Vector3d around = load_.axis.cross(outward);
  const double angle = angle_rad_ + std::remainder(AngleAbout(load_.axis, tangent) - angle_rad_,
                                                   2 * std::numbers::pi);
  const vessel::Step fade = vessel::SmoothStep(rho / kFade);
  const double slope = fade.slope / kFade;
  const double curvature = fade.curvature / (kFade * kFade);
  out.gradient -= load_.moment_mJ * (slope * angle * outward + (fade.value / rho) * around);
  const Matrix3d mixed = outward * around.transpose() + around * outward.transpose();
  out.hessian -= load_.moment_mJ * (curvature * angle * outward * outward.transpose() +
                                    (slope * angle / rho) * around * around.transpose() +
                                    (slope / rho - fade.value / (rho * rho)) * mixed);
  return -load_.moment_mJ * fade.value * angle;
}

double PointLoad::Add(const PointSet& points, PointDerivatives& out) const {
  const int q = points.size() - 1;
  if (q < 0) return 0;
  const auto p = static_cast<std::size_t>(q);
  double energy = 0;
  if (!load_.force_N.isZero(0) || load_.hold_N_mm != 0) {
    const Vector3d& end = points.position[p];
    const Vector3d away = end - load_.place_mm;
    if (load_.hold_N_mm == 0) {
      out.TouchGradient(q);
    } else {
      out.Touch(q);
      if (out.with_hessian) out.hessian[p] += load_.hold_N_mm * Matrix3d::Identity();
    }
    out.gradient[p] += load_.hold_N_mm * away - load_.force_N;
    energy += load_.hold_N_mm * away.squaredNorm() / 2 - load_.force_N.dot(end);
  }
  if (load_.moment_mJ != 0 || load_.align_mJ != 0) {
    const Vector3d tangent = points.Tangent(q);
    TangentLoad on{q / points.per_segment, -load_.align_mJ * load_.direction, Matrix3d::Zero()};
    energy += load_.align_mJ * (tangent - load_.direction).squaredNorm() / 2;
    if (load_.moment_mJ != 0) energy += Turn(tangent, on);
    out.on_tangents.push_back(on);
  }
  return energy;
}

std::uint64_t PointLoad::Hash(std::uint64_t seed) const {
  if (angle_rad_ == 0) return seed;
  return (seed ^ std::bit_cast<std::uint64_t>(angle_rad_)) * 0x100000001b3ULL;
}

namespace {

constexpr Key kForce = {"force_mN", "mN", 0, 1e6, 0, "that pulls the end towards force_direction"};
constexpr Key kMoment = {
    "moment_mN_mm", "mN mm", -1e8, 1e8, 0, "that turns the last segment about moment_axis"};
constexpr Key kHold = {
    "clamp_N_mm", "N/mm", 0, 1e4, 0, "stiffness of a spring from the end to clamp_point_mm"};
constexpr Key kAlign = {"clamp_mN_mm",
                        "mN mm",
                        0,
                        1e8,
                        0,
                        "moment that holds the end in clamp_direction, by "
                        "the sine of the angle between"};

// The magnitude of one of the loads; it and its direction or place go together.
double ReadPart(StrictTable& keys, const Key& magnitude, const char* with) {
  if (keys.Has(magnitude.name) != keys.Has(with)) {
    keys.Refuse(keys.Has(with) ? with : magnitude.name,
                std::string("needs ") + (keys.Has(with) ? magnitude.name : with) +
                    " beside it; give both or none");
  }
  return magnitude.Read(keys);
}

std::unique_ptr<Effect> Make(StrictTable& keys, const EffectContext& context) {
  EndLoad load;
  const double force_N = 1e-3 * ReadPart(keys, kForce, "force_direction");
  load.moment_mJ = 1e-3 * ReadPart(keys, kMoment, "moment_axis");
  load.hold_N_mm = ReadPart(keys, kHold, "clamp_point_mm");
  load.align_mJ = 1e-3 * ReadPart(keys, kAlign, "clamp_direction");
  if (keys.Has("force_direction")) {
    load.force_N = force_N * ReadPatientDirection(keys, "force_direction", context);
  }
  if (keys.Has("moment_axis")) load.axis = ReadPatientDirection(keys, "moment_axis", context);
  if (keys.Has("clamp_point_mm")) load.place_mm = keys.Point("clamp_point_mm");
  if (keys.Has("clamp_direction")) {
    load.direction = ReadPatientDirection(keys, "clamp_direction", context);
  }
  if (force_N == 0 && load.moment_mJ == 0 && load.hold_N_mm == 0 && load.align_mJ == 0) {
    keys.Refuse("force_mN", "nothing acts on the end; give a force, a moment or a clamp");
  }
  return std::make_unique<PointLoad>(load);
}

}  // namespace

EffectKind PointLoadKind() {
  const char* const direction = "[x, y, z] or left, right, anterior, posterior, superior, inferior";
  return {.name = "point_load",
          .summary = "a force, a moment or a clamp at the wire's distal end",
          .roles = "energy term",
          .keys = {kForce, kMoment, kHold, kAlign},
          .other_keys = {{"force_direction", direction, "of the force, which keeps it"},
                         {"moment_axis", direction, "about which the moment turns"},
                         {"clamp_point_mm", "[x, y, z], mm", "where the end is held"},
                         {"clamp_direction", direction, "in which it is held"}},
          .needs = "",
          .make = Make};
}

}  // namespace torquer::effects
