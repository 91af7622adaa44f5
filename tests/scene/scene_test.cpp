#include "host/simulator/scene/scene.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <string>

#include "host/support/error.h"
#include "tests/support/temporary_folder.h"

using Catch::Matchers::Contains;
using torquer::scene::Scene;

namespace {

const std::string kGood = R"(name = "test"

[vessel]
kind = "phantom"
phantom = "ty"
wall_stiffness_N_mm2 = 0.01

[entry]
centerline = "main"
at_mm = 1

[wire]
segment_mm = 1
max_length_mm = 200
radius_mm = 0.2
tip_mm = 10
tip_angle_deg = 30
rigidity_N_mm2 = 6.35e-3
)";

// What a scene of that text says when it is refused; "" when it is taken.
std::string Refusal(const std::string& text) {
  const torquer::test::TemporaryFolder folder;
  const std::string path = folder.Path() + "/test.toml";
  std::ofstream(path) << text;
  try {
    const Scene scene(path);
  } catch (const torquer::UserError& error) {
    std::string what = error.what();
    CHECK_THAT(what, Contains("test.toml"));
    return what;
  }
  return "";
}

std::string With(const std::string& from, const std::string& to) {
  std::string text = kGood;
  const auto at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

}  // namespace

TEST_CASE("A good scene is taken", "[scene]") {
  CHECK(Refusal(kGood).empty());
  CHECK(Refusal(kGood + "[effects.friction]\ncoefficient = 0.1\n").empty());
  CHECK(
      Refusal(kGood + "[relaxation]\nmethod = \"paper\"\nupdate_rule = \"exact_root\"\n").empty());
}

TEST_CASE("A scene is refused with line, key, value and remedy", "[scene]") {
  struct Case {
    std::string text;
    std::vector<std::string> said;
  };
  const Case cases[] = {
      {With("radius_mm = 0.2", "radius_mm = -0.2"), {":15: wire.radius_mm = -0.2", "0.01 to 5"}},
      {With("radius_mm = 0.2", "radius_mm = nan"), {":15: wire.radius_mm = nan", "give"}},
      {With("radius_mm = 0.2", "radius_mm = \"thin\""), {"wire.radius_mm", "not a number"}},
      {With("radius_mm = 0.2", "radius = 0.2"), {"wire.radius_mm: is missing"}},
      {With("radius_mm = 0.2", "radius_mm = 0.2\nradios_mm = 1"),
       {":16: wire.radios_mm", "did you mean radius_mm?"}},
      {With("radius_mm = 0.2", "radius_mm = 4.5"), {"does not fit", "thinner wire"}},
      {With("name = \"test\"", ""), {"name: is missing"}},
      {With("phantom = \"ty\"", "phantom = \"yt\""), {":5: vessel.phantom", "\"ty\""}},
      {With("kind = \"phantom\"", "kind = \"surface\"\nfile = \"none.stl\"\nmesh_unit = \"mm\""),
       {"none.stl"}},
      {With("centerline = \"main\"", "centerline = \"mian\""), {":9: entry.centerline", "main"}},
      {With("centerline = \"main\"\nat_mm = 1", "point_mm = [0, 50, 0]\ndirection = [1, 0, 0]"),
       {"outside the lumen", "the wire would fit at"}},
      {With("centerline = \"main\"\nat_mm = 1", "point_mm = [1, 0, 0]\ndirection = [0, 0, 0]"),
       {"entry.direction", "no length"}},
      {With("tip_mm = 10", "tip_mm = 0"), {"wire.tip_mm", "at least a segment"}},
      {With("tip_angle_deg = 30", "tip_angle_deg = 400"), {"wire.tip_angle_deg = 400"}},
      {With("max_length_mm = 200", "max_length_mm = 200\ninserted_at_start_mm = 300"),
       {"wire.inserted_at_start_mm = 300", "0 to 200"}},
      {With("segment_mm = 1\n", "segment_mm = 20\n"), {"wire.segment_mm = 20"}},
      {With("rigidity_N_mm2 = 6.35e-3",
            "rigidities_N_mm2 = [1, 2]\nrigidities_from_tip_mm = [0, 0]"),
       {"rigidities_from_tip_mm", "ascend"}},
      {With("wall_stiffness_N_mm2 = 0.01", ""), {"vessel.wall_stiffness_N_mm2: is missing"}},
      {kGood + "[effects.frction]\n", {"effects.frction", "did you mean friction?"}},
      {kGood + "[effects.friction]\n", {"effects.friction.coefficient: is missing"}},
      {kGood + "[effects.friction]\ncoefficient = 3\n", {"effects.friction.coefficient = 3"}},
      {kGood + "[relaxation]\nmethod = \"paper\"\n[effects.friction]\ncoefficient = 0.1\n",
       {"effects.friction", "newton"}},
      {kGood + "[relaxation]\nmethod = \"newton\"\nupdate_rule = \"signed\"\n",
       {"relaxation.update_rule"}},
      {kGood + "[patient_axes]\nleft = \"+x\"\nposterior = \"+y\"\nsuperior = \"-z\"\n",
       {"patient_axes.superior", "right-handed"}},
      {kGood + "[patient_axes]\nleft = \"right\"\n", {"patient_axes.left", "+x"}},
      {"name = ", {":1:", "not valid TOML"}},
  };
  for (const Case& one : cases) {
    INFO(one.text);
    const std::string said = Refusal(one.text);
    for (const std::string& part : one.said) CHECK_THAT(said, Contains(part));
  }
  CHECK_THROWS_WITH(Scene("no/such.toml"), Contains("no/such.toml"));
}

TEST_CASE("A wire that starts advanced lies along the centerline, at rest", "[scene]") {
  const torquer::test::TemporaryFolder folder;
  const std::string path = folder.Path() + "/test.toml";
  std::ofstream(path) << With("max_length_mm = 200",
                              "max_length_mm = 200\ninserted_at_start_mm = 150.25");
  Scene scene(path);
  const auto relaxation = scene.MakeRelaxation();
  const torquer::WireState state = scene.MakeStart(*relaxation);
  CHECK(state.ArcLength(scene.wire()) == Approx(150.25).epsilon(1e-12));
  CHECK(relaxation->Current().residual <= 1e-6);
  double distance = 0;
  const auto& path_curve = scene.vessel().centerlines.curves()[0];
  for (const auto& node : state.nodes) {
    distance = std::max(distance, path_curve.NearestTo(node).distance_mm);
    CHECK(scene.vessel().field->Clearance(node) > 0);
  }
  // Relaxed, it leaves the centerline, but not the lumen of 4 mm radius around it.
  CHECK(distance > 0.5);
  CHECK(distance < 4);
}
