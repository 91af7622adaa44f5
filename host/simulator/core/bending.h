// Bending energy of a joint between two segments.
//
// The energy is C g, with C = EI / (length of wire that the joint stands for). All laws are written
// in y = |u_b - r|^2 / 2 = 1 - cos(theta). Here r is the rest direction of the distal segment u_b,
// and theta the angle between them. Unlike 1 - dot(r, u_b), this form does not cancel for small
// bends.
//
//   exact  g = theta sin(theta/2)                    Baier et al. 2016, eq. (2)
//   g1     g = y + y^2/12                            eq. (4), to fourth order in theta
//   g2     g = y - y^2/2 = (1 - cos^2 theta) / 2     Alderliesten et al. 2004
#pragma once

#include <cmath>

namespace torquer {

enum class BendingLaw { kExact, kG1, kG2 };

/// g and its first two derivatives with respect to y.
struct BendingValue {
  double g = 0;
  double slope = 0;
  double curvature = 0;
};

/// g(y), g'(y), g''(y) for y in [0, 2].
///
/// The exact law has a cone at theta = pi, where a rod would have kinked long before. Past
/// y = 1.9 (154 degrees) it is continued by its second-order Taylor polynomial, so that every
/// derivative stays finite.
inline BendingValue EvaluateBending(BendingLaw law, double y) {
  if (law == BendingLaw::kG1) return {y + y * y / 12, 1 + y / 6, 1.0 / 6};
  if (law == BendingLaw::kG2) return {y - y * y / 2, 1 - y, -1};
  // 2 s asin(s) with s^2 = y/2 as a series; the omitted terms are below 1e-15 of the sum.
  constexpr double kC[] = {1.0,          1.0 / 12,     3.0 / 160,      5.0 / 896,
                           35.0 / 18432, 63.0 / 90112, 231.0 / 851968, 143.0 / 1310720};
  if (y < 1e-4) {  // where most joints of a fine wire are
    return {y * (1 + y * (kC[1] + y * (kC[2] + y * kC[3]))),
            1 + y * (2 * kC[1] + y * (3 * kC[2] + y * (4 * kC[3]))),
            2 * kC[1] + y * (6 * kC[2] + y * (12 * kC[3]))};
  }
  if (y < 0.06) {
    double g = 0;
    double slope = 0;
    double curvature = 0;
    for (int k = 7; k > 0; --k) {
      g = (g + kC[k]) * y;
      slope = (slope + kC[k] * (k + 1)) * y;
      curvature = curvature * y + kC[k] * (k + 1) * k;
    }
    return {(g + 1) * y, slope + 1, curvature};
  }
  constexpr double kLimit = 1.9;
  const double z = std::fmin(y, kLimit);
  const double s = std::sqrt(z / 2);
  const double c = std::sqrt(1 - z / 2);
  const double theta = 2 * std::asin(s);
  BendingValue v{theta * s, 1 / (2 * c) + theta / (4 * s),
                 1 / (8 * c * c * c) + 1 / (8 * s * s * c) - theta / (16 * s * s * s)};
  if (y > kLimit) {
    const double d = y - kLimit;
    v.g += d * (v.slope + d * v.curvature / 2);
    v.slope += d * v.curvature;
  }
  return v;
}

}  // namespace torquer
