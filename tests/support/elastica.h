// Closed form of a cantilever under a dead force at its end, across it at the clamp (Bisshopp &
// Drucker 1945). It is the limit of the wire for small segments.
#pragma once

#include <cmath>

namespace torquer::test {

struct Elastica {
  double along = 0;      ///< end position along the clamp, over the length
  double across = 0;     ///< across it, towards the force, over the length
  double end_angle = 0;  ///< rad
};

/// `load` = F L^2 / EI > 0.
inline Elastica SolveElastica(double load) {
  const double alpha = std::sqrt(load);
  const auto first_angle = [](double k) { return std::asin(1 / (k * std::sqrt(2.0))); };
  const auto excess = [&](double k) {
    return std::comp_ellint_1(k) - std::ellint_1(k, first_angle(k)) - alpha;
  };
  double low = std::sqrt(0.5) * (1 + 1e-15);
  double high = 1 - 1e-15;
  for (int i = 0; i < 200; ++i) {
    const double middle = (low + high) / 2;
    (excess(middle) < 0 ? low : high) = middle;
  }
  const double k = (low + high) / 2;
  Elastica e;
  e.end_angle = std::asin(2 * k * k - 1);
  e.along = std::sqrt(2 * std::sin(e.end_angle)) / alpha;
  e.across = 1 - 2 / alpha * (std::comp_ellint_2(k) - std::ellint_2(k, first_angle(k)));
  return e;
}

}  // namespace torquer::test
