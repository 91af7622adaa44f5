#include "host/simulator/effects/loads/point_load.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host/simulator/core/hash.h"
#include "host/simulator/vessel/smooth_step.h"

namespace torquer::effects {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// Sine of the angle to the axis below which the moment fades.
constexpr double kFade = 0.1;

// Angle of a direction about a unit axis.
double AngleAbout(const Vector3d& axis, const Vector3d& direction) {
  Eigen::Index smallest = 0;
  axis.cwiseAbs().minCoeff(&smallest);
  const Vector3d unit = Vector3d::Unit(smallest);
  const Vector3d first = (unit - unit.dot(axis) * axis).normalized();
  return std::atan2(axis.cross(first).dot(direction), first.dot(direction));
}

}  // namespace

void PointLoad::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const PointLoad&>(twin);
  load_ = from.load_;
  elapsed_s_ = from.elapsed_s_;
  fraction_ = from.fraction_;
  angle_rad_ = from.angle_rad_;
}

void PointLoad::Reset() {
  if (ramp_s_ > 0) fraction_ = 0;
  angle_rad_ = 0;
}

void PointLoad::Begin(const PointSet& points) {
  if (ramp_s_ > 0) fraction_ = std::min(1.0, elapsed_s_ / ramp_s_);
  if (load_.moment_mJ == 0 || points.size() == 0 || !points.among.is_farthest) return;
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
  const double moment_mJ = fraction_ * load_.moment_mJ;
  out.gradient -= moment_mJ * (slope * angle * outward + (fade.value / rho) * around);
  const Matrix3d mixed = outward * around.transpose() + around * outward.transpose();
  out.hessian -= moment_mJ * (curvature * angle * outward * outward.transpose() +
                              (slope * angle / rho) * around * around.transpose() +
                              (slope / rho - fade.value / (rho * rho)) * mixed);
  return -moment_mJ * fade.value * angle;
}

double PointLoad::Add(const PointSet& points, PointDerivatives& out) const {
  const int q = points.size() - 1;
  if (q < 0 || !points.among.is_farthest || fraction_ == 0) return 0;
  const auto p = static_cast<std::size_t>(q);
  double energy = 0;
  if (!load_.force_N.isZero(0) || load_.hold_N_mm != 0) {
    const Vector3d& end = points.position[p];
    const Vector3d away = end - load_.place_mm;
    const double hold_N_mm = fraction_ * load_.hold_N_mm;
    const Vector3d force_N = fraction_ * load_.force_N;
    if (hold_N_mm == 0) {
      out.TouchGradient(q);
    } else {
      out.Touch(q);
      if (out.with_hessian) out.hessian[p] += hold_N_mm * Matrix3d::Identity();
    }
    out.gradient[p] += hold_N_mm * away - force_N;
    energy += hold_N_mm * away.squaredNorm() / 2 - force_N.dot(end);
  }
  if (load_.moment_mJ != 0 || load_.align_mJ != 0) {
    const Vector3d tangent = points.Tangent(q);
    const double align_mJ = fraction_ * load_.align_mJ;
    TangentLoad on{q / points.per_segment, -align_mJ * load_.direction, Matrix3d::Zero()};
    energy += align_mJ * (tangent - load_.direction).squaredNorm() / 2;
    if (load_.moment_mJ != 0) energy += Turn(tangent, on);
    out.on_tangents.push_back(on);
  }
  return energy;
}

std::uint64_t PointLoad::Hash(std::uint64_t seed) const {
  if (ramp_s_ > 0) seed = HashDouble(fraction_, HashDouble(elapsed_s_, seed));
  return angle_rad_ == 0 ? seed : HashDouble(angle_rad_, seed);
}

namespace {

struct PointLoadSpec : TableSpec {
  double force_mN = 0;
  std::optional<DirectionSpec> force_direction;
  double moment_mN_mm = 0;
  std::optional<DirectionSpec> moment_axis;
  double clamp_N_mm = 0;
  std::optional<Vector3d> clamp_point_mm;
  double clamp_mN_mm = 0;
  std::optional<DirectionSpec> clamp_direction;
  double ramp_s = 0;
};

// The magnitude of a load requires its direction or place, and vice versa.
void Check(const PointLoadSpec& spec, StrictTable& table) {
  const auto together = [&](const char* magnitude, const char* with) {
    if (table.Has(magnitude) == table.Has(with)) return;
    const bool lone = table.Has(with);
    table.Refuse(lone ? with : magnitude,
                 std::string("needs ") + (lone ? magnitude : with) + "; give both keys or neither");
  };
  together("force_mN", "force_direction");
  together("moment_mN_mm", "moment_axis");
  together("clamp_N_mm", "clamp_point_mm");
  together("clamp_mN_mm", "clamp_direction");
  if (spec.force_mN == 0 && spec.moment_mN_mm == 0 && spec.clamp_N_mm == 0 &&
      spec.clamp_mN_mm == 0) {
    table.Refuse("force_mN",
                 "no load acts on the distal end; give force_mN, moment_mN_mm, clamp_N_mm or "
                 "clamp_mN_mm a value other than 0");
  }
}

const Keys<PointLoadSpec>& PointLoadKeys() {
  static const Keys<PointLoadSpec> keys =
      Keys<PointLoadSpec>()
          .Number("force_mN", &PointLoadSpec::force_mN, 0, 1e6, "mN",
                  "magnitude of the force on the distal end")
          .Otherwise("none: no force")
          .Direction("force_direction", &PointLoadSpec::force_direction,
                     "direction of the force, fixed in the vessel frame")
          .Number("moment_mN_mm", &PointLoadSpec::moment_mN_mm, -1e8, 1e8, "mN mm",
                  "moment on the last segment, right-handed about moment_axis")
          .Otherwise("none: no moment")
          .Direction("moment_axis", &PointLoadSpec::moment_axis, "axis of the moment")
          .Number("clamp_N_mm", &PointLoadSpec::clamp_N_mm, 0, 1e4, "N/mm",
                  "stiffness of the spring that holds the distal end at clamp_point_mm")
          .Otherwise("none: no spring")
          .Point("clamp_point_mm", &PointLoadSpec::clamp_point_mm, "mm",
                 "point at which the spring holds the distal end")
          .Number("clamp_mN_mm", &PointLoadSpec::clamp_mN_mm, 0, 1e8, "mN mm",
                  "moment that holds the last segment in clamp_direction, per sine of the angle "
                  "between them")
          .Otherwise("none: no clamping moment")
          .Direction("clamp_direction", &PointLoadSpec::clamp_direction,
                     "direction in which the clamp holds the last segment")
          .Number("ramp_s", &PointLoadSpec::ramp_s, 0, 1e4, "s",
                  "time from the start over which forces, moments and stiffnesses grow from 0 to "
                  "their values; 0: they act at once")
          .Checked(Check)
          .Example(
              "force_mN = 2\n"
              "force_direction = [0, 0, 1]\n");
  return keys;
}

std::unique_ptr<Effect> MakePointLoad(const PointLoadSpec& spec, const EffectContext& context) {
  EndLoad load;
  if (spec.force_direction) {
    load.force_N = 1e-3 * spec.force_mN * context.Direction(*spec.force_direction);
  }
  load.moment_mJ = 1e-3 * spec.moment_mN_mm;
  if (spec.moment_axis) load.axis = context.Direction(*spec.moment_axis);
  load.hold_N_mm = spec.clamp_N_mm;
  if (spec.clamp_point_mm) load.place_mm = *spec.clamp_point_mm;
  load.align_mJ = 1e-3 * spec.clamp_mN_mm;
  if (spec.clamp_direction) load.direction = context.Direction(*spec.clamp_direction);
  return std::make_unique<PointLoad>(load, spec.ramp_s);
}

}  // namespace

EffectKind PointLoadKind() {
  return {.name = "point_load",
          .summary = "force, moment or clamp at the distal end",
          .roles = "energy term, timed",
          .keys = Any(PointLoadKeys()),
          .make = MakeWith(MakePointLoad)};
}

}  // namespace torquer::effects
