// The bricks that the wire looks up against the exact distance, in all shipped scenes of tubes.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "host/simulator/scene/scene.h"
#include "host/simulator/vessel/brick_field.h"
#include "tests/support/sanitizer.h"

namespace {

using Catch::Contains;
using torquer::ClearanceSample;
using torquer::scene::Scene;
using torquer::vessel::Vessel;

// Errors of the bricks at random places within 1 mm of the wall, beside the centerlines.
struct BrickErrors {
  std::vector<double> distance_um;
  std::vector<double> direction_rad;  // of the gradient
};

BrickErrors Compare(const Vessel& vessel, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> any(0, 1);
  std::normal_distribution<double> normal;
  BrickErrors errors;
  constexpr std::size_t kPlaces = torquer::test::Rounds(4000, 8);
  while (errors.distance_um.size() < kPlaces) {
    const auto& curves = vessel.centerlines.curves();
    const auto& curve = curves[random() % curves.size()];
    const auto at = curve.At(any(random) * curve.length_mm());
    const Eigen::Vector3d aside(normal(random), normal(random), normal(random));
    const Eigen::Vector3d place_mm =
        at.position_mm + (at.radius_mm + 2 * any(random) - 1) * aside.normalized();
    ClearanceSample exact, brick;
    vessel.field->EvaluateGradient(place_mm, exact);
    if (std::abs(exact.clearance_mm) > 1) continue;
    vessel.bricks->EvaluateGradient(place_mm, brick);
    errors.distance_um.push_back(1e3 * std::abs(brick.clearance_mm - exact.clearance_mm));
    errors.direction_rad.push_back((brick.gradient - exact.gradient).norm());
  }
  std::sort(errors.distance_um.begin(), errors.distance_um.end());
  std::sort(errors.direction_rad.begin(), errors.direction_rad.end());
  return errors;
}

double Share(const std::vector<double>& sorted, double share) {
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

TEST_CASE("Bricks of tubes have the exact distance and direction near the wall", "[scene]") {
  for (const std::string name :
       {"beating_heart", "buddy_wire", "calcified", "coronary", "drill_tube", "everything"}) {
    const Scene scene(name);
    REQUIRE(scene.vessel().bricks != nullptr);
    CHECK(&scene.vessel().wire_field() == scene.vessel().bricks.get());
    const BrickErrors errors = Compare(scene.vessel(), 7);
    INFO(name);
    CHECK(Share(errors.distance_um, 0.5) < 0.1);
    CHECK(Share(errors.distance_um, 0.99) < 10);
    CHECK(errors.distance_um.back() < 20);
    CHECK(Share(errors.direction_rad, 0.5) < 1e-3);
    CHECK(Share(errors.direction_rad, 0.99) < 0.1);
  }
}

// Scene with one tube that is thin for its length.
std::string LongThinTube(const std::string& more) {
  return "name = \"thin\"\n[vessel]\nkind = \"tubes\"\nwall_stiffness_N_mm2 = 1\n" + more +
         "[[vessel.tube]]\nname = \"t\"\npoints_mm = [[0, 0, 0], [900, 900, 900]]\n"
         "radii_mm = 0.2\n[entry]\ncenterline = \"t\"\nat_mm = 1\n[[instrument]]\n"
         "max_length_mm = 50\nradius_mm = 0.1\ntip_mm = 1\ntip_angle_deg = 0\n"
         "rigidity_N_mm2 = 0.01\n";
}

TEST_CASE("A wire looks up the exact distance where bricks would not fit into memory", "[scene]") {
  using torquer::scene::ParseScene;
  const Scene exact(ParseScene(LongThinTube(""), "thin.toml", "."));
  CHECK(exact.vessel().bricks == nullptr);
  CHECK(&exact.vessel().wire_field() == exact.vessel().field.get());
  const Scene coarse(ParseScene(LongThinTube("voxel_mm = 0.5\n"), "thin.toml", "."));
  CHECK(coarse.vessel().bricks->options().voxel_mm == 0.5);
  CHECK_THROWS_WITH(Scene(ParseScene(LongThinTube("voxel_mm = 0.03\n"), "thin.toml", ".")),
                    Contains("thin.toml:5") && Contains("voxel_mm") && Contains("larger voxel_mm"));
}

}  // namespace
