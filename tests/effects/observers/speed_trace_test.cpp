#include "host/simulator/effects/observers/speed_trace.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

namespace torquer::effects {
namespace {

// Position at the fraction `t` (0 to 1) of a minimum-jerk movement over `distance_mm`.
double MinimumJerk(double distance_mm, double t) {
  return distance_mm * t * t * t * (10 - 15 * t + 6 * t * t);
}

SpeedTrace Trace(double duration_s, int movements) {
  SpeedTrace trace;
  for (double t = 0; t < duration_s; t += 0.001) {
    const double phase = t / duration_s * movements;
    const double done = std::floor(phase);
    trace.Add(t, 40 * done + MinimumJerk(40, phase - done));
  }
  return trace;
}

TEST_CASE("A single movement of minimum jerk has the known smoothness") {
  // Closed form: 720 / 1.875^2. It is dimensionless, so short and long movements agree. Only the
  // smoothing over 0.1 s removes some jerk at both ends.
  for (const double duration_s : {5.0, 20.0}) {
    const SpeedTrace trace = Trace(duration_s, 1);
    const double smoothed = 0.5 / duration_s;
    CHECK(trace.log_dimensionless_jerk() ==
          Approx(-std::log(720 / (1.875 * 1.875))).margin(0.02 + smoothed));
    CHECK(trace.peak_mm_s() == Approx(1.875 * 40 / duration_s).epsilon(0.01));
    CHECK(trace.submovements() == 1);
  }
}

TEST_CASE("A movement in pieces counts its pieces and is less smooth") {
  const SpeedTrace trace = Trace(6, 4);
  CHECK(trace.submovements() == 4);
  CHECK(trace.log_dimensionless_jerk() < Trace(6, 1).log_dimensionless_jerk() - 3);
}

TEST_CASE("Speed that dips within a movement begins a new one, even or not") {
  SpeedTrace trace;
  double position_mm = 0;
  for (double t = 0; t < 6; t += 0.001) {
    // 12 +- 9 mm/s: three dips to 3 mm/s, which is not rest, separate four movements.
    position_mm += 0.001 * (12 + 9 * std::sin(2 * std::numbers::pi * t / 2));
    trace.Add(t, position_mm);
  }
  CHECK(trace.submovements() == 4);
}

TEST_CASE("A hand at rest moves neither up nor down in smoothness") {
  SpeedTrace trace;
  for (double t = 0; t < 5; t += 0.001)
    trace.Add(t, 0.02 * std::floor(50 * t));  // 1 mm/s, stepwise
  CHECK(trace.submovements() == 0);
  CHECK(trace.mean_moving_mm_s() == Approx(1).epsilon(0.02));
  SpeedTrace still;
  for (double t = 0; t < 5; t += 0.001) still.Add(t, 7);
  // Smoothness is undefined without motion; 0 would be the best value.
  CHECK(std::isnan(still.log_dimensionless_jerk()));
  CHECK(std::isnan(still.mean_moving_mm_s()));
}

TEST_CASE("A tick that comes late counts as if its motion had been even") {
  SpeedTrace trace;
  trace.Add(0, 0);
  trace.Add(0.5, 5);
  trace.Add(2, 20);
  CHECK(trace.peak_mm_s() == Approx(10));
  CHECK(trace.mean_moving_mm_s() == Approx(10).epsilon(0.05));
}

}  // namespace
}  // namespace torquer::effects
