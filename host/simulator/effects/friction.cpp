#include "host/simulator/effects/friction.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace torquer::effects {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Friction::Friction(double coefficient, double slip_mm, const EffectContext& context)
    : coefficient_(coefficient),
      slip_mm_(slip_mm),
      anchors_(static_cast<std::size_t>(context.wire.max_segments() + 1) *
               static_cast<std::size_t>(context.wall.points_per_segment)) {}

void Friction::Reset() {
  for (Anchor& anchor : anchors_) anchor = Anchor();
}

void Friction::Begin(const PointSet& points) {
  for (int q = 0; q < points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    Anchor& anchor = anchors_[points.FromTip(q)];
    anchor.limit_N = 0;
    if (!anchor.holds || !points.touches[p]) continue;
    const ClearanceSample& sample = points.clearance[p];
    const double slope = sample.gradient.norm();
    if (!(slope > 1e-6)) continue;
    anchor.normal = sample.gradient / slope;
    anchor.limit_N = coefficient_ * points.stiffness_N_mm2[p] * points.weight_mm[p] *
                     (points.radius_mm[p] - sample.clearance_mm) * slope;
  }
}

double Friction::Add(const PointSet& points, PointDerivatives& out) const {
  double energy = 0;
  for (int q = 0; q < points.size(); ++q) {
    const Anchor& anchor = anchors_[points.FromTip(q)];
    if (anchor.limit_N == 0) continue;
    const auto p = static_cast<std::size_t>(q);
    Vector3d s = points.position[p] - anchor.at;
    s -= s.dot(anchor.normal) * anchor.normal;
    const double squared = s.squaredNorm();
    const double x2 = squared / (slip_mm_ * slip_mm_);
    out.Touch(q);
    const Matrix3d across = Matrix3d::Identity() - anchor.normal * anchor.normal.transpose();
    if (x2 < 1) {
      const double stiffness = 1.5 * anchor.limit_N / slip_mm_;
      energy += stiffness * squared * (0.5 - x2 / 12);
      out.gradient[p] += (stiffness * (1 - x2 / 3)) * s;
      if (out.with_hessian) {
        out.hessian[p] += (stiffness * (1 - x2 / 3)) * across -
                          (stiffness * 2 / (3 * slip_mm_ * slip_mm_)) * s * s.transpose();
      }
    } else {
      const double distance = std::sqrt(squared);
      energy += anchor.limit_N * (distance - 0.375 * slip_mm_);
      out.gradient[p] += (anchor.limit_N / distance) * s;
      if (out.with_hessian) {
        out.hessian[p] += (anchor.limit_N / distance) * (across - s * s.transpose() / squared);
      }
    }
  }
  return energy;
}

void Friction::End(const PointSet& points) {
  for (int q = 0; q < points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    Anchor& anchor = anchors_[points.FromTip(q)];
    if (!points.touches[p]) {
      anchor.holds = false;
      continue;
    }
    if (!anchor.holds) {
      anchor.holds = true;
      anchor.at = points.position[p];
      continue;
    }
    Vector3d s = points.position[p] - anchor.at;
    const Vector3d& gradient = points.clearance[p].gradient;
    s -= (s.dot(gradient) / std::max(gradient.squaredNorm(), 1e-12)) * gradient;
    const double distance = s.norm();
    if (distance > slip_mm_) anchor.at = points.position[p] - (slip_mm_ / distance) * s;
  }
  // What left through the sheath will touch somewhere else when it comes back.
  for (int k = points.size(); k < anchored_; ++k) anchors_[static_cast<std::size_t>(k)] = Anchor();
  anchored_ = points.size();
}

std::uint64_t Friction::Hash(std::uint64_t seed) const {
  for (const Anchor& anchor : anchors_) {
    if (!anchor.holds) continue;
    for (const double value : {anchor.at[0], anchor.at[1], anchor.at[2]}) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &value, sizeof bits);
      seed = (seed ^ bits) * 0x100000001b3ULL;
    }
  }
  return seed;
}

EffectKind FrictionKind() {
  static const Key kCoefficient = {"coefficient", "", 0, 2, std::nullopt, "of Coulomb's law, mu"};
  static const Key kSlip = {
      "slip_mm", "mm", 1e-5, 0.1, 0.005, "displacement at which a sticking contact begins to slip"};
  return {.name = "friction",
          .summary = "Coulomb friction of the wire on the wall, with stick and slip",
          .roles = "energy term",
          .keys = {kCoefficient, kSlip},
          .other_keys = {},
          .needs = "",
          .make = [](StrictTable& keys, const EffectContext& context) -> std::unique_ptr<Effect> {
            const double coefficient = kCoefficient.Read(keys);
            return std::make_unique<Friction>(coefficient, kSlip.Read(keys), context);
          }};
}

}  // namespace torquer::effects
