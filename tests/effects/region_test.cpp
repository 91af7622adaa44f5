#include "host/simulator/vessel/region.h"

#include <catch2/catch.hpp>

#include "host/simulator/vessel/phantoms.h"
#include "tests/support/finite_differences.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

using vessel::Region;
using vessel::RegionWeight;

vessel::Centerline Bow() {
  std::vector<Vector3d> points;
  std::vector<double> radii;
  for (int k = 0; k <= 40; ++k) {
    const double a = 0.05 * k;
    points.emplace_back(30 * std::sin(a), 30 * (1 - std::cos(a)), 0);
    radii.push_back(3);
  }
  return {"bow", points, radii};
}

std::vector<Region> Samples() {
  return {Region::Ball(Vector3d(1, 2, 3), 4, 3), Region::Stretch(Bow(), 10, 40, 5, 4),
          Region::Side(Vector3d(2, 0, 0), Vector3d(0.6, 0.8, 0), 6)};
}

Vector3d Random(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> at(-size, size);
  const double x = at(random);
  const double y = at(random);
  return {x, y, at(random)};
}

TEST_CASE("A region's gradient and Hessian are those of its weight, and its slope is bounded") {
  std::mt19937 random(5);
  for (const Region& region : Samples()) {
    int inside = 0;
    int edge = 0;
    double steepest = 0;
    for (int k = 0; k < 60000; ++k) {
      const Vector3d at = Vector3d(10, 5, 0) + Random(random, 25);
      RegionWeight weight;
      if (!region.Evaluate(at, weight)) {
        REQUIRE(region.Weight(at) == 0);
        continue;
      }
      REQUIRE(weight.value == Approx(region.Weight(at)).margin(1e-12));
      REQUIRE((weight.value >= 0 && weight.value <= 1));
      inside += weight.value == 1;
      steepest = std::max(steepest, weight.gradient.norm());
      if (weight.value == 1 || edge >= 150) continue;
      ++edge;
      const auto value = [&](const Eigen::VectorXd& x) { return region.Weight(x); };
      CHECK((GradientOf(value, at, 1e-4) - weight.gradient).norm() < 1e-7);
      CHECK((HessianOf(value, at, 1e-3) - weight.hessian).norm() < 2e-4);
    }
    CHECK(inside > 50);
    CHECK(edge == 150);
    CHECK(steepest < region.SteepestSlope());
    CHECK(steepest > 0.3 * region.SteepestSlope());
  }
}

TEST_CASE("A stretch is one within its radius of the curve, and zero beyond its edge") {
  const vessel::Centerline bow = Bow();
  const Region region = Region::Stretch(bow, 10, 40, 5, 2);
  for (double s = 10; s <= 40; s += 0.37) {
    const vessel::CenterlineSample at = bow.At(s);
    const Vector3d up = Vector3d::UnitZ();
    CHECK(region.Weight(at.position_mm + 4.99 * up) == 1);
    CHECK(region.Weight(at.position_mm + 7.2 * up) == 0);
  }
  CHECK(region.Weight(bow.At(0).position_mm) == 0);
  CHECK(region.Weight(bow.At(50).position_mm) == 0);
}

TEST_CASE("The soft edge lies outside a ball or a stretch, and inside a side") {
  // Expected by the reference of edge_mm.
  const Region ball = Region::Ball(Vector3d::Zero(), 5, 2);
  CHECK(ball.Weight(Vector3d(5, 0, 0)) == 1);
  CHECK(ball.Weight(Vector3d(6, 0, 0)) == Approx(0.5));
  CHECK(ball.Weight(Vector3d(7, 0, 0)) == 0);
  const Region side = Region::Side(Vector3d(10, 0, 0), Vector3d::UnitX(), 4);
  CHECK(side.Weight(Vector3d(10, 3, 0)) == 0);
  CHECK(side.Weight(Vector3d(12, 3, 0)) == Approx(0.5));
  CHECK(side.Weight(Vector3d(14, 3, 0)) == 1);
}

TEST_CASE("A region reports if it meets the lumen") {
  const vessel::TubeVessel tube = vessel::MakeStraightTube(100, 3);
  const auto meets = [&](const Region& region) {
    return region.MeetsLumen(*tube.field, tube.centerlines, tube.bounds_mm);
  };
  CHECK(meets(Region::Ball(Vector3d(50, 0, 0), 1, 0.5)));
  CHECK(meets(Region::Ball(Vector3d(50, 5, 0), 2.5, 0.5)));  // touches only its rim
  CHECK_FALSE(meets(Region::Ball(Vector3d(50, 10, 0), 3, 1)));
  CHECK(meets(Region::Side(Vector3d(90, 0, 0), Vector3d::UnitX(), 2)));
  CHECK_FALSE(meets(Region::Side(Vector3d(120, 0, 0), Vector3d::UnitX(), 2)));
}

// A stretch beside the lumen, so that the search ends only after all points, without a result.
TEST_CASE("The search of a stretch for the lumen grows with its length") {
  const auto comparisons = [](double length_mm) {
    const vessel::TubeVessel tube = vessel::MakeStraightTube(length_mm, 3);
    std::vector<Vector3d> points;
    for (int k = 0; k <= 100; ++k) points.emplace_back(length_mm * k / 100, 4.5, 0);
    const vessel::Centerline beside("beside", points, std::vector<double>(points.size(), 1));
    const Region region = Region::Stretch(beside, 0, length_mm, 1, 0.5);
    std::int64_t count = 0;
    CHECK_FALSE(region.MeetsLumen(*tube.field, tube.centerlines, tube.bounds_mm, &count));
    return count;
  };
  const std::int64_t once = comparisons(50);
  CHECK(once > 10'000);  // a grid about each of its hundred balls
  CHECK(comparisons(400) < 10 * once);
}

}  // namespace
}  // namespace torquer::test
