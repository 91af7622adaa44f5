// Lumen in the picture of the paper study: it must be the simulated one.
#include "host/study/lumen_view.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "host/simulator/vessel/phantoms.h"

namespace torquer::study {
namespace {

using Eigen::Vector3d;

bool Seen(const std::vector<LumenRun>& runs, double x_mm, double y_mm, double step_mm) {
  for (const LumenRun& run : runs) {
    if (std::abs(run.y_mm - y_mm) <= 0.51 * step_mm && x_mm >= run.from_mm && x_mm <= run.to_mm) {
      return true;
    }
  }
  return false;
}

TEST_CASE("A straight tube is seen as a rectangle with round ends") {
  constexpr double kRadius = 3;
  constexpr double kLength = 20;
  constexpr double kStep = 0.1;
  const vessel::TubeVessel tube = vessel::MakeStraightTube(kLength, kRadius);
  double area_mm2 = 0;
  for (const LumenRun& run : SeeLumen(*tube.field, tube.bounds_mm, kStep)) {
    const double cap_mm = std::sqrt(std::max(0.0, kRadius * kRadius - run.y_mm * run.y_mm));
    CHECK(run.from_mm == Approx(-cap_mm).margin(0.02));
    CHECK(run.to_mm == Approx(kLength + cap_mm).margin(0.02));
    area_mm2 += kStep * (run.to_mm - run.from_mm);
  }
  CHECK(area_mm2 == Approx(2 * kRadius * kLength + M_PI * kRadius * kRadius).epsilon(0.02));
}

TEST_CASE("All of the phantom is in view, the far wall of its T too") {
  constexpr double kStep = 0.5;
  const vessel::TubeVessel phantom = vessel::MakeTyPhantom();
  const std::vector<LumenRun> runs = SeeLumen(*phantom.field, phantom.bounds_mm, kStep);
  // Contact point of a wire that comes straight out of the stem. It lies beyond the corner that the
  // centerlines cut off.
  CHECK(phantom.field->Clearance({103.5, -1, 0}) > 0);
  CHECK(Seen(runs, 103.5, -1, kStep));
  CHECK_FALSE(Seen(runs, 106, -1, kStep));
  for (const vessel::Centerline& curve : phantom.centerlines.curves()) {
    for (const Vector3d& p : curve.points_mm()) CHECK(Seen(runs, p[0], p[1], kStep));
  }
}

}  // namespace
}  // namespace torquer::study
