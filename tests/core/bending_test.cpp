#include "host/simulator/core/bending.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace torquer {
namespace {

double Y(double theta) { return 1 - std::cos(theta); }

TEST_CASE("Bending laws have the values of their formulas") {
  for (const double theta : {0.05, 0.2, 0.5, 1.0, 2.0, 2.6}) {
    const double c = std::cos(theta);
    INFO("theta " << theta);
    CHECK(EvaluateBending(BendingLaw::kExact, Y(theta)).g ==
          Approx(theta * std::sin(theta / 2)).epsilon(1e-13));
    CHECK(EvaluateBending(BendingLaw::kG1, Y(theta)).g ==
          Approx((13 - 14 * c + c * c) / 12).epsilon(1e-13));
    CHECK(EvaluateBending(BendingLaw::kG2, Y(theta)).g == Approx((1 - c * c) / 2).epsilon(1e-13));
  }
}

TEST_CASE("All bending laws are theta^2/2 for small bends") {
  for (const BendingLaw law : {BendingLaw::kExact, BendingLaw::kG1, BendingLaw::kG2}) {
    const double theta = 1e-4;
    // 1 - cos loses digits by cancellation; its half-angle form does not.
    const double y = 2 * std::sin(theta / 2) * std::sin(theta / 2);
    CHECK(EvaluateBending(law, y).g == Approx(theta * theta / 2).epsilon(1e-7));
    CHECK(EvaluateBending(law, 0).g == 0);
    CHECK(EvaluateBending(law, 0).slope == 1);
  }
}

TEST_CASE("Below 0.1 rad g1 is off by 4.7e-5 % and g2 by 0.29 %, as Baier et al. 2016 state") {
  double worst_g1 = 0;
  double worst_g2 = 0;
  for (int k = 1; k <= 50; ++k) {
    const double theta = 0.002 * k;
    const double exact = EvaluateBending(BendingLaw::kExact, Y(theta)).g;
    worst_g1 =
        std::fmax(worst_g1, std::abs(EvaluateBending(BendingLaw::kG1, Y(theta)).g / exact - 1));
    worst_g2 =
        std::fmax(worst_g2, std::abs(EvaluateBending(BendingLaw::kG2, Y(theta)).g / exact - 1));
  }
  CHECK(100 * worst_g1 == Approx(4.7e-5).epsilon(0.03));
  CHECK(100 * worst_g2 == Approx(0.29).epsilon(0.03));
}

TEST_CASE("Slopes and curvatures of the bending laws are derivatives") {
  for (const BendingLaw law : {BendingLaw::kExact, BendingLaw::kG1, BendingLaw::kG2}) {
    for (const double y : {0.01, 0.03, 0.0599, 0.0601, 0.3, 1.0, 1.7, 1.95}) {
      INFO("law " << static_cast<int>(law) << " y " << y);
      const double h = 1e-6;
      const BendingValue at = EvaluateBending(law, y);
      const BendingValue up = EvaluateBending(law, y + h);
      const BendingValue down = EvaluateBending(law, y - h);
      CHECK(at.slope == Approx((up.g - down.g) / (2 * h)).epsilon(1e-8).margin(1e-9));
      CHECK(at.curvature == Approx((up.slope - down.slope) / (2 * h)).epsilon(1e-7).margin(1e-8));
    }
  }
}

TEST_CASE("Series and closed form of the exact law agree at their border") {
  const double y = 0.06;
  const BendingValue series = EvaluateBending(BendingLaw::kExact, std::nextafter(y, 0.0));
  const BendingValue closed = EvaluateBending(BendingLaw::kExact, y);
  CHECK(series.g == Approx(closed.g).epsilon(1e-14));
  CHECK(series.slope == Approx(closed.slope).epsilon(1e-13));
  CHECK(series.curvature == Approx(closed.curvature).epsilon(1e-10));
}

TEST_CASE("The exact law is continued past 154 degrees with two continuous derivatives") {
  const double limit = 1.9;
  const BendingValue below = EvaluateBending(BendingLaw::kExact, limit - 1e-9);
  const BendingValue above = EvaluateBending(BendingLaw::kExact, limit + 1e-9);
  CHECK(above.g == Approx(below.g).epsilon(1e-8));
  CHECK(above.slope == Approx(below.slope).epsilon(1e-8));
  CHECK(above.curvature == Approx(below.curvature).epsilon(1e-7));
  const BendingValue end = EvaluateBending(BendingLaw::kExact, 2);
  CHECK(std::isfinite(end.g));
  CHECK(end.slope > below.slope);
  CHECK(end.curvature == Approx(below.curvature).epsilon(1e-7));
}

}  // namespace
}  // namespace torquer
