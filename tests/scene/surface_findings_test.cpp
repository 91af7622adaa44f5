// Findings on the centerlines of a surface.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>

#include "host/simulator/scene/scene.h"
#include "tests/support/made_meshes.h"
#include "tests/support/temporary_folder.h"

namespace {

// A curve in a tube of radius 3 mm that reaches from the origin to (40, 0, 0) mm.
struct MadeCurve {
  double begin_mm = 0;
  double end_mm = 30;
  double radius_mm = 3;
  double first_radius_mm = 3;
  std::string surface_comment = "";  // first line of the surface file
  std::string system = "";           // coordinateSystem of the curve
};

std::string FindingsOn(const MadeCurve& curve) {
  const torquer::test::TemporaryFolder folder;
  torquer::vessel::WriteObj(folder.Path("plain.obj"),
                            torquer::vessel::MakeTubeMesh(40, 12, 40, [](double) { return 3.0; }));
  std::ofstream(folder.Path("tube.obj")) << curve.surface_comment << "\n"
                                         << std::ifstream(folder.Path("plain.obj")).rdbuf();
  std::filesystem::create_directories(folder.Path("curves"));
  std::ofstream(folder.Path("curves/main.mrk.json"))
      << R"({"markups": [{"type": "Curve", )"
      << (curve.system.empty() ? "" : "\"coordinateSystem\": \"" + curve.system + "\", ")
      << R"("controlPoints": [{"position": [)" << curve.begin_mm << R"(, 0, 0]}, {"position": [)"
      << curve.end_mm << R"(, 0, 0]}], "measurements": )"
      << R"([{"name": "Radius", "controlPointValues": [)" << curve.first_radius_mm << ", "
      << curve.radius_mm << "]}]}]}";
  std::ofstream(folder.Path("test.toml")) << R"(name = "test"
[vessel]
kind = "surface"
file = "tube.obj"
mesh_unit = "mm"
centerlines = "curves"
voxel_mm = 1
wall_stiffness_N_mm2 = 1
[entry]
point_mm = [5, 0, 0]
direction = [1, 0, 0]
[[instrument]]
max_length_mm = 20
radius_mm = 0.2
rigidity_N_mm2 = 6.35e-3
)";
  const torquer::scene::Scene scene(folder.Path("test.toml"));
  std::string all;
  for (const std::string& finding : scene.vessel().findings) {
    if (finding.find("run outside") != std::string::npos) all += finding;
  }
  return all;
}

// Findings on a curve that begins `before_mm` before the end of its tube.
std::string FindingsOn(double before_mm, double radius_mm = 3, double first_mm = 3) {
  return FindingsOn({.begin_mm = -before_mm, .radius_mm = radius_mm, .first_radius_mm = first_mm});
}

}  // namespace

TEST_CASE("A curve that ends at the surface does not run outside it", "[scene]") {
  CHECK(FindingsOn(0).empty());
  CHECK(FindingsOn(0.02).empty());
}

TEST_CASE("A curve that begins outside runs outside up to the surface", "[scene]") {
  const std::string said = FindingsOn(2.5);
  const std::string before =
      "1 of 1 centerlines run outside the lumen in places, by up to 2.5 mm. Places in mm of their "
      "length: main (0.0 to ";
  REQUIRE(said.substr(0, before.size()) == before);
  // The surface lies 2.5 mm along the curve, and its field is as exact as a voxel allows.
  CHECK(std::stod(said.substr(before.size())) == Approx(2.5).margin(0.2));
}

TEST_CASE("A radius in the wrong unit is refused by the room in the surface", "[scene]") {
  // The tube has the radius 3 mm. A real vessel may be half as wide as its curve says.
  CHECK(FindingsOn(0, 6).empty());
  CHECK(FindingsOn(0, 14).empty());
  CHECK_THROWS_WITH(FindingsOn(0, 30),
                    Catch::Contains("test.toml:") &&
                        Catch::Contains("curves/main.mrk.json: the Radius 30.0 mm") &&
                        Catch::Contains("at (30.0, 0.0, 0.0) mm, is 30 mm") &&
                        Catch::Contains("but the wall is nowhere more than 2.") &&
                        Catch::Contains("name the unit of the radii in \"units\""));
  CHECK(FindingsOn(0, 0.3).empty());
  CHECK_THROWS_WITH(
      FindingsOn(0, 0.3, 0.31),
      Catch::Contains("the Radius 1.0 mm") &&
          Catch::Contains("is 0.3097 mm, the largest of all, but the wall is up to 2.") &&
          Catch::Contains("name the unit of the radii in \"units\""));
}

TEST_CASE("Curves in the other system of patients are refused if the surface names none",
          "[scene]") {
  MadeCurve curve{.begin_mm = 0, .end_mm = -30, .system = "LPS"};
  CHECK_THROWS_WITH(
      FindingsOn(curve),
      Catch::Contains("test.toml:") &&
          Catch::Contains(
              "curves: 0 % of the centerlines' length lies in the lumen, but 97 % with the other "
              "signs of x and y") &&
          Catch::Contains("SPACE=LPS or SPACE=RAS in a comment at the beginning of the surface"));
  // The remedy of the message.
  curve.surface_comment = "# SPACE=RAS";
  CHECK(FindingsOn(curve).empty());
  curve.system = "";
  CHECK_THROWS_WITH(FindingsOn(curve), Catch::Contains("\"coordinateSystem\" in the curves"));
  // Most of this curve lies in the lumen, so it is in the right system.
  CHECK_FALSE(FindingsOn({.begin_mm = -25, .end_mm = 30}).empty());
}
