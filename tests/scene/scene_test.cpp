#include "host/simulator/scene/scene.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>

#include "host/support/error.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;
using torquer::scene::Scene;

namespace {

const std::string kGood = R"(name = "test"

[vessel]
kind = "ty_phantom"
wall_stiffness_N_mm2 = 0.01

[entry]
centerline = "main"
at_mm = 1

[[instrument]]
max_length_mm = 200
radius_mm = 0.2
tip_mm = 10
tip_angle_deg = 30
rigidity_N_mm2 = 6.35e-3
)";

// Catheter around the guidewire.
const std::string kCatheter = R"(
[[instrument]]
name = "catheter"
max_length_mm = 150
inner_radius_mm = 0.3
radius_mm = 0.5
rigidity_N_mm2 = 0.01
)";

// Part of the main path with more friction; its radius is missing.
const std::string kRegion =
    "[effects.friction]\ncoefficient = 0.1\n[[effects.friction.region]]\ncenterline = \"main\"\n"
    "factor = 2\n";

// Error message for a scene of that text; "" if it is accepted.
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

std::string WithIn(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

std::string With(const std::string& from, const std::string& to) { return WithIn(kGood, from, to); }

// [0,1,2,..]
std::string Numbers(int count) {
  std::string list = "[0";
  for (int k = 1; k < count; ++k) list += "," + std::to_string(k);
  return list + "]";
}

std::string Tubes(int count) {
  std::string tables;
  for (int k = 0; k < count; ++k) {
    tables += "[[vessel.tube]]\nname = \"t\"\npoints_mm = [[0, 0, 0], [9, 0, 0]]\nradii_mm = 2\n";
  }
  return tables;
}

}  // namespace

TEST_CASE("A good scene is taken", "[scene]") {
  CHECK(Refusal(kGood).empty());
  CHECK(Refusal(kGood + "[effects.friction]\ncoefficient = 0.1\n").empty());
  CHECK(Refusal(kGood + "[relaxation]\nmethod = \"paper\"\n[relaxation.paper]\n"
                        "update_rule = \"exact_root\"\n")
            .empty());
  CHECK(Refusal(kGood + kCatheter).empty());
  CHECK(Refusal(kGood + kRegion + "radius_mm = 0.3\n").empty());
  CHECK(
      Refusal(With("radius_mm = 0.2", "radius_mm = 0.2\nfrom_tip_mm = " + Numbers(1000))).empty());
}

TEST_CASE("A scene is refused with line, key, value and remedy", "[scene]") {
  struct Case {
    std::string text;
    std::vector<std::string> said;
  };
  const Case cases[] = {
      {With("radius_mm = 0.2", "radius_mm = -0.2"),
       {":13: instrument[0].radius_mm = -0.2", "0.01 to 5"}},
      {With("radius_mm = 0.2", "radius_mm = nan"), {":13: instrument[0].radius_mm = nan", "give"}},
      {With("radius_mm = 0.2", "radius_mm = \"thin\""),
       {"instrument[0].radius_mm", "not a list of numbers", "give"}},
      {With("radius_mm = 0.2", "radius_mm = []"), {":13: instrument[0].radius_mm", "give"}},
      {With("radius_mm = 0.2", "radius = 0.2"), {":11: instrument[0].radius_mm: is missing"}},
      {With("radius_mm = 0.2", "radius_mm = 0.2\nradios_mm = 1"),
       {":14: instrument[0].radios_mm", "did you mean radius_mm?"}},
      {With("radius_mm = 0.2", "radius_mm = 4.5"), {"does not fit", "thinner wire"}},
      {With("radius_mm = 0.2", "radius_mm = [0.2, 0.3, 0.4]\nfrom_tip_mm = [0, 10]"),
       {":13: instrument[0].radius_mm", "has 3 values", "one for each of the 2 of from_tip_mm"}},
      {With("radius_mm = 0.2", "radius_mm = 0.2\nfrom_tip_mm = [0, 9, 8]"),
       {":14: instrument[0].from_tip_mm", "increase"}},
      {With("radius_mm = 0.2", "radius_mm = 0.2\nfrom_tip_mm = [0, 9, 9, 9]"),
       {":14: instrument[0].from_tip_mm", "increase"}},
      {With("radius_mm = 0.2", "radius_mm = 0.2\nfrom_tip_mm = " + Numbers(1001)),
       {":14: instrument[0].from_tip_mm", "has 1001 values; give at most 1000"}},
      {With("kind = \"ty_phantom\"", "kind = \"tubes\"") + Tubes(1001),
       {"vessel.tube = ", "has 1001 tables; give at most 1000"}},
      {With("name = \"test\"", ""), {"name: is missing"}},
      {With("[[instrument]]\n", "[instrument]\n"), {":11: instrument", "[[instrument]]"}},
      {"name = \"test\"\n[vessel]\nkind = \"ty_phantom\"\nwall_stiffness_N_mm2 = 1\n"
       "[entry]\ncenterline = \"main\"\n",
       {"instrument: is missing", "[[instrument]]"}},
      {With("kind = \"ty_phantom\"", "kind = \"ty_fantom\""),
       {":4: vessel.kind", "did you mean \"ty_phantom\"?"}},
      {With("kind = \"ty_phantom\"", "kind = \"surface\"\nfile = \"none.stl\"\nmesh_unit = \"mm\""),
       {"none.stl"}},
      {With("kind = \"ty_phantom\"", "kind = \"ty_phantom\"\nradius_mm = 3"),
       {":5: vessel.radius_mm", "not a known key"}},
      {With("centerline = \"main\"", "centerline = \"mian\""), {":8: entry.centerline", "main"}},
      {With("centerline = \"main\"\nat_mm = 1", "point_mm = [0, 50, 0]\ndirection = [1, 0, 0]"),
       {"outside the lumen", "the wire would fit at"}},
      {With("centerline = \"main\"\nat_mm = 1", "point_mm = [1, 0, 0]\ndirection = [0, 0, 0]"),
       {"entry.direction", "no length"}},
      {With("centerline = \"main\"\nat_mm = 1", "point_mm = [1, 0, 0]"),
       {"entry.direction: is missing"}},
      {With("at_mm = 1", "at_mm = 1\npoint_mm = [1, 0, 0]\ndirection = [1, 0, 0]"),
       {":10: entry.point_mm", "one of the two"}},
      {With("tip_mm = 10", "tip_mm = 0"), {"instrument[0].tip_angle_deg", "needs tip_mm"}},
      {With("tip_mm = 10", "tip_mm = 0.5"), {":14: instrument[0].tip_mm", "at least one segment"}},
      {With("tip_angle_deg = 30", "tip_angle_deg = 400"), {"instrument[0].tip_angle_deg = 400"}},
      {With("tip_angle_deg = 30", "tip_angle_deg = 30\ncurvature_1_per_mm = 0.1"),
       {"instrument[0].tip_angle_deg", "keep one"}},
      {With("max_length_mm = 200", "max_length_mm = 200\ninserted_at_start_mm = 300"),
       {":13: instrument[0].inserted_at_start_mm = 300", "max_length_mm"}},
      {With("rigidity_N_mm2 = 6.35e-3", "rigidity_N_mm2 = [1, 2]"),
       {":16: instrument[0].rigidity_N_mm2", "has 2 values"}},
      {With("max_length_mm = 200", "max_length_mm = 200\nname = \"guide wire\""),
       {":13: instrument[0].name", "letters"}},
      {With("wall_stiffness_N_mm2 = 0.01", ""), {"vessel.wall_stiffness_N_mm2: is missing"}},
      {kGood + "[relaxation]\nsegment_mm = 20\n", {":18: relaxation.segment_mm = 20"}},
      {kGood + "[effects.frction]\n", {"effects.frction", "did you mean friction?"}},
      {kGood + "[effects.friction]\n", {"effects.friction.coefficient: is missing"}},
      {kGood + "[effects.friction]\ncoefficient = 3\n", {":18: effects.friction.coefficient = 3"}},
      {kGood + kRegion + "radius_mm = 0.1\n",
       {"effects.friction.region[0].radius_mm = 0.1", "is too small for 28", "give at least 0.28"}},
      {kGood + "[effects.contrast]\nrate_mL_s = 2\n",
       {":17: effects.contrast", "needs [effects.flow]"}},
      {kGood + "[relaxation]\nmethod = \"paper\"\n[effects.friction]\ncoefficient = 0.1\n",
       {":19: effects.friction", "newton"}},
      {kGood + "[relaxation]\nmethod = \"paper\"\nlongest_feed_mm = 0.5\n",
       {":19: relaxation.longest_feed_mm", "one segment at a time", "remove it"}},
      {kGood + "[relaxation]\nmethod = \"paper\"\ntolerance_mm = 0.5\n",
       {":19: relaxation.tolerance_mm", "estimates no error"}},
      {kGood + "[relaxation]\nmethod = \"newton\"\n[relaxation.paper]\nupdate_rule = \"signed\"\n",
       {":19: relaxation.paper", "method = \"paper\""}},
      {kGood + "[patient_axes]\nleft = \"+x\"\nposterior = \"+y\"\nsuperior = \"-z\"\n",
       {":20: patient_axes.superior", "right-handed"}},
      {kGood + "[patient_axes]\nleft = \"right\"\n", {":18: patient_axes.left", "+x"}},
      {"name = ", {":1:", "not valid TOML"}},
      // Several instruments.
      {kGood + kCatheter + kCatheter, {"instrument[2].name", "another instrument"}},
      {kGood + WithIn(kCatheter, "inner_radius_mm = 0.3", "inner_radius_mm = 0.2"),
       {":21: instrument[1].inner_radius_mm = 0.2", "more than the radius of guidewire, 0.2 mm",
        "innermost instrument first"}},
      {kGood + WithIn(kCatheter, "inner_radius_mm = 0.3\n", ""),
       {"instrument[1].inner_radius_mm", "more than the radius of guidewire"}},
      {kGood + WithIn(kCatheter, "radius_mm = 0.5", "radius_mm = [0.5, 0.3]\nfrom_tip_mm = [0, 9]"),
       {":21: instrument[1].inner_radius_mm = 0.3", "less than the outer radius, 0.3 mm"}},
      {kGood + kCatheter + "[relaxation]\nmethod = \"paper\"\n",
       {":19: instrument[1].name", "single instrument", "newton"}},
  };
  for (const Case& one : cases) {
    INFO(one.text);
    const std::string said = Refusal(one.text);
    for (const std::string& part : one.said) CHECK_THAT(said, Contains(part));
  }
  CHECK_THROWS_WITH(Scene("no/such.toml"), Contains("no/such.toml"));
}

TEST_CASE("Torquer's scenes are found by name, unless a file is called so") {
  namespace fs = std::filesystem;
  using torquer::scene::ScenePath;
  const auto scene = torquer::scene::ReadScene("ty_phantom");
  CHECK(scene.name == "ty_phantom");
  CHECK_THAT(scene.path, Catch::EndsWith("/scenes/ty_phantom.toml"));
  CHECK_THROWS_WITH(ScenePath("ty_phantoms"),
                    Catch::StartsWith("ty_phantoms: there is no such file") &&
                        Contains(" neuro_arch,") && Contains(" ty_phantom"));
  CHECK(ScenePath("folder/ty_phantom") == "folder/ty_phantom");
  CHECK(ScenePath("ty_phantom.toml") == "ty_phantom.toml");

  const torquer::test::TemporaryFolder folder;
  const fs::path before = fs::current_path();
  fs::current_path(folder.Path());
  std::ofstream("ty_phantom") << kGood;
  CHECK(torquer::scene::ReadScene("ty_phantom").name == "test");
  fs::current_path(before);
}

TEST_CASE("A wire that starts advanced lies along the centerline, at rest", "[scene]") {
  const torquer::test::TemporaryFolder folder;
  const std::string path = folder.Path() + "/test.toml";
  std::ofstream(path) << With("max_length_mm = 200",
                              "max_length_mm = 200\ninserted_at_start_mm = 150.25");
  Scene scene(path);
  const auto relaxation = scene.MakeRelaxation();
  const torquer::WireState state = scene.MakeStart(*relaxation);
  CHECK(state.ArcLength(scene.stack().empty_rod()) == Approx(150.25).epsilon(1e-12));
  CHECK(relaxation->Current().residual <= 1e-6);
  double distance = 0;
  const auto& path_curve = scene.vessel().centerlines.curves()[0];
  for (const auto& node : state.nodes()) {
    distance = std::max(distance, path_curve.NearestTo(node).distance_mm);
    CHECK(scene.vessel().field->Clearance(node) > 0);
  }
  // At equilibrium the wire leaves the centerline, but not the lumen of 4 mm radius around it.
  CHECK(distance > 0.5);
  CHECK(distance < 4);
}
