// Spheres whose union is a tube, and the one of a piece that reaches furthest beyond a point.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace torquer::vessel {

// Distance d to the axis as a function Q of u = d^2, rounded for d < round. The even polynomial
// round (3/8 + 3/4 (d/round)^2 - 1/8 (d/round)^4) meets d with two derivatives at d = round.
struct RoundedDistance {
  double value, first, second;  // Q, dQ/du, d2Q/du2
};

// Always inline: otherwise the sources in the same batch decide, and a look-up costs a fifth more.
[[gnu::always_inline]] inline RoundedDistance Rounded(double u, double round) {
  if (u >= round * round) {
    const double d = std::sqrt(u);
    return {d, 0.5 / d, -0.25 / (d * u)};
  }
  const double inverse = 1 / round;
  const double w = u * inverse * inverse;
  return {round * (0.375 + w * (0.75 - 0.125 * w)), inverse * (0.75 - 0.25 * w),
          -0.25 * inverse * inverse * inverse};
}

// A sphere of a tube against a point p, with v = p - center and the tangent t of the axis.
struct SphereOffset {
  double distance2, along, curved;  // |v|^2, v . t, v . axis''
};

// Sphere at u of a primitive. `own`: the point in the primitive's axes, from its origin.
template <typename Primitive>
[[gnu::always_inline]] inline SphereOffset SphereAt(const Primitive& primitive,
                                                    const Eigen::Vector3d& own, double u) {
  if (!primitive.is_arc) {
    const double along = own[0] - u;
    return {along * along + own[1] * own[1] + own[2] * own[2], along, 0};
  }
  const double angle = u / primitive.bend_radius - primitive.half_angle;
  const double c = std::cos(angle), s = std::sin(angle);
  const double out = c * own[0] + s * own[1] - primitive.bend_radius;
  const double along = c * own[1] - s * own[0];
  return {along * along + out * out + own[2] * own[2], along, -out / primitive.bend_radius};
}

// Moves u from the foot of a point to the sphere that reaches furthest, by Newton's method. `foot`:
// the sphere at u. Returns how far it reaches beyond the point.
template <typename Primitive>
double Climb(const Primitive& primitive, const Eigen::Vector3d& own, double round_mm,
             const SphereOffset& foot, double& u, bool& interior) {
  // The last step squares the error.
  constexpr double kLastStepMm = 1e-8;
  SphereOffset at = foot;
  const auto reach = [&](const RoundedDistance& distance) {
    return primitive.r0 + u * (primitive.r1 + u * (primitive.r2 + u * primitive.r3)) -
           distance.value;
  };
  for (int iteration = 0; iteration < 20; ++iteration) {
    const RoundedDistance q = Rounded(at.distance2, round_mm);
    const double slope =
        primitive.r1 + u * (2 * primitive.r2 + 3 * u * primitive.r3) + 2 * q.first * at.along;
    const double bend = 2 * primitive.r2 + 6 * u * primitive.r3 + 2 * q.first * (at.curved - 1) -
                        4 * q.second * at.along * at.along;
    const double step = bend < 0 ? -slope / bend : (slope > 0 ? 1.0 : -1.0);
    const double next = std::clamp(u + step, 0.0, primitive.length);
    const double change = next - u;
    interior = next == u + step;
    const double value = reach(q) + change * (slope + change * bend / 2);
    u = next;
    if (std::abs(change) < kLastStepMm) return value;
    at = SphereAt(primitive, own, u);
  }
  return reach(Rounded(at.distance2, round_mm));
}

}  // namespace torquer::vessel
