// Smooth step: a step from 0 to 1 without a kink.
#pragma once

namespace torquer::vessel {

/// A value with its first two derivatives.
struct Step {
  double value = 0;
  double slope = 0;
  double curvature = 0;
};

/// 0 up to x = 0, 1 from x = 1, between them 10 x^3 - 15 x^4 + 6 x^5. Two derivatives are
/// continuous.
inline Step SmoothStep(double x) {
  if (x <= 0) return {0, 0, 0};
  if (x >= 1) return {1, 0, 0};
  const double rest = 1 - x;
  return {x * x * x * (10 + x * (6 * x - 15)), 30 * x * x * rest * rest,
          60 * x * rest * (1 - 2 * x)};
}

/// Largest slope of SmoothStep.
inline constexpr double kSteepestStep = 1.875;

}  // namespace torquer::vessel
