#include "calibration/student_t.h"

#include <cassert>
#include <cmath>

// Formulas by number: Abramowitz and Stegun, "Handbook of Mathematical Functions" (1964).
namespace torquer::calibration {
namespace {

constexpr double kNormalHalfWidth95 = 1.959963984540054;

// The continued fraction of the incomplete beta function (26.5.8), from the back. So many terms do
// for a and b up to some thousands.
double BetaFraction(double a, double b, double x) {
  constexpr int kTerms = 150;
  double fraction = 1.0;
  for (int term = kTerms; term >= 1; --term) {
    const double m = term / 2;  // NOLINT(bugprone-integer-division): whole on purpose
    const double above = term % 2 == 0 ? m * (b - m) : -(a + m) * (a + b + m);
    const double below =
        term % 2 == 0 ? (a + 2 * m - 1) * (a + 2 * m) : (a + 2 * m) * (a + 2 * m + 1);
    fraction = 1.0 + above / below * x / fraction;
  }
  return 1.0 / fraction;
}

// I_x(a, b), of which the fraction converges fast on one side of the mean only (26.5.2).
double IncompleteBeta(double a, double b, double x) {
  const double front = std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) +
                                a * std::log(x) + b * std::log1p(-x));
  if (x < (a + 1.0) / (a + b + 2.0)) return front * BetaFraction(a, b, x) / a;
  return 1.0 - front * BetaFraction(b, a, 1.0 - x) / b;
}

// Probability of being farther out than t, both sides together (26.7.1).
double BothTails(double t, double degrees_of_freedom) {
  return IncompleteBeta(0.5 * degrees_of_freedom, 0.5,
                        degrees_of_freedom / (degrees_of_freedom + t * t));
}

}  // namespace

double StudentHalfWidth95(double degrees_of_freedom) {
  assert(degrees_of_freedom >= 0.5);
  if (degrees_of_freedom > 2000.0) {  // 26.7.5
    const double z = kNormalHalfWidth95;
    return z + (z * z * z + z) / (4.0 * degrees_of_freedom);
  }
  double low = kNormalHalfWidth95;
  double high = 1000.0;
  while (high - low > 1e-10 * high) {
    const double middle = 0.5 * (low + high);
    (BothTails(middle, degrees_of_freedom) > 0.05 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace torquer::calibration
