// Scene keys of effects: accepted values, and refused ones with their error messages.
#include <catch2/catch.hpp>

#include "host/simulator/scene/scene.h"
#include "host/support/error.h"
#include "tests/support/scenes.h"

using Catch::Contains;

namespace torquer::test {
namespace {

std::string Refusal(const std::string& more) {
  const SceneFile file(more);
  try {
    const scene::Scene scene(file.path());
  } catch (const UserError& error) {
    CHECK_THAT(error.what(), Contains("small.toml:"));
    return error.what();
  }
  return "";
}

constexpr char kBall[] = "center_mm = [50, 0, 0]\nradius_mm = 5\n";

TEST_CASE("Effects with good keys are taken") {
  for (const std::string& good : {
           std::string("[[effects.compliance.region]]\nfactor = 10\n") + kBall,
           std::string("[[effects.compliance.region]]\nstiffness_N_mm2 = 1\ncenterline = \"side\"\n"
                       "radius_mm = 6\n"),
           std::string("coating_mm = 50\ncoating_coefficient = 0.02\n[effects.friction]\n"
                       "coefficient = 0.1\n[[effects.friction.region]]\nfactor = 3\n") +
               kBall,
           std::string("from_tip_mm = [0, 20]\nfriction_coefficient = [0.02, 0.2]\n"
                       "[effects.friction]\ncoefficient = 0.1\n"),
           std::string("linear_density_g_m = 0.6\n[effects.gravity]\n"),
           std::string("[effects.point_load]\nforce_mN = 1\nforce_direction = \"left\"\n"),
           std::string("[effects.heartbeat]\namplitude_mm = 1\ndirection = \"anterior\"\n"
                       "[[effects.heartbeat.region]]\n") +
               kBall,
       }) {
    INFO(good);
    CHECK(Refusal(good).empty());
  }
}

TEST_CASE("Effects with bad keys are refused with line, key, value and remedy") {
  const std::string compliance = "[[effects.compliance.region]]\n";
  const std::string beat = "[effects.heartbeat]\ndirection = [1, 0, 0]\namplitude_mm = ";
  const std::string beaten = "\n[[effects.heartbeat.region]]\n";
  const std::string breath = "[effects.breathing]\ndirection = [1, 0, 0]\namplitude_mm = 1\n";
  struct Case {
    std::string text;
    std::vector<std::string> said;
  };
  const Case cases[] = {
      {"[effects.compliance]\n", {"effects.compliance.region", "[[effects.compliance.region]]"}},
      {compliance + kBall, {"factor", "give either factor or stiffness_N_mm2"}},
      {compliance + kBall + "factor = 2\nstiffness_N_mm2 = 1\n", {"not both"}},
      {compliance + kBall + "factor = -2\n", {"region[0].factor = -2", "0.0001 to 10000"}},
      {compliance + kBall + "factor = nan\n", {"factor = nan"}},
      {compliance + "factor = 2\n",
       {"center_mm", "a region needs exactly one shape", "centerline"}},
      {compliance + "factor = 2\ncenter_mm = [50, 30, 0]\nradius_mm = 5\n",
       {"center_mm", "contains no part of the vessel's lumen"}},
      {compliance + "factor = 2\ncenterline = \"mian\"\nradius_mm = 5\n", {"centerline", "main"}},
      {compliance + "factor = 2\ncenterline = \"main\"\nfrom_mm = 50\nto_mm = 20\nradius_mm = 5\n",
       {"to_mm", "more than from_mm"}},
      {compliance + "factor = 2\ncenterline = \"main\"\nfrom_mm = 5000\nradius_mm = 5\n",
       {"from_mm = 5000", "is 284.4 mm long"}},
      {compliance + "factor = 2\nside_of_mm = [1e4, 0, 0]\nside = [1, 0, 0]\nedge_mm = 1\n",
       {"side_of_mm", "contains no part"}},
      {compliance + kBall + "factor = 2\nrdius_mm = 3\n", {"rdius_mm", "did you mean radius_mm"}},
      {"coating_mm = 50\n[effects.friction]\ncoefficient = 0.1\n", {"coating_coefficient"}},
      {"coating_coefficient = 0.05\n[effects.friction]\ncoefficient = 0.1\n", {"coating_mm"}},
      {"friction_coefficient = [0.1, 0.2, 0.3]\n[effects.friction]\ncoefficient = 0.1\n",
       {"friction_coefficient", "has 3 values", "from_tip_mm"}},
      {"friction_coefficient = [0.1, 2.5]\n[effects.friction]\ncoefficient = 0.1\n",
       {"friction_coefficient = [ 0.1, 2.5 ]", "holds 2.5", "0 to 2"}},
      {"from_tip_mm = [0, 20]\nfriction_coefficient = [0.1, 0.2]\ncoating_mm = 5\n"
       "coating_coefficient = 0.02\n[effects.friction]\ncoefficient = 0.1\n",
       {"coating_mm", "a list of friction_coefficient", "keep one"}},
      {"[effects.friction]\ncoefficient = 0.1\n[[effects.friction.region]]\nfactor = 30\n" +
           std::string(kBall),
       {"factor = 30", "0 to 20"}},
      {"[effects.gravity]\n", {"linear_density_g_m"}},
      {"linear_density_g_m = 1\n[effects.gravity]\ndirection = \"down\"\n",
       {"direction", "posterior"}},
      {"linear_density_g_m = 1\n[effects.gravity]\ndirection = [0, 0, 0]\n", {"has no length"}},
      {"[effects.point_load]\n", {"no load acts on the distal end"}},
      {"[effects.point_load]\nforce_mN = 2\n", {"force_mN = 2", "needs force_direction"}},
      {"[effects.point_load]\nmoment_axis = [0, 0, 1]\n", {"needs moment_mN_mm"}},
      {"[effects.point_load]\nclamp_N_mm = 2\n", {"needs clamp_point_mm"}},
      {"[effects.point_load]\nclamp_mN_mm = nan\nclamp_direction = [1, 0, 0]\n", {"clamp_mN_mm"}},
      {beat + "1\n", {"effects.heartbeat.region", "is missing"}},
      {beat + "5" + beaten + kBall + "edge_mm = 6\n",
       {"effects.heartbeat.amplitude_mm = 5", "fold the vessel over", "at most 2.56 mm"}},
      {beat + "inf" + beaten + kBall, {"effects.heartbeat.amplitude_mm"}},
      {beat + "1\nrate_per_min = 0" + beaten + kBall, {"rate_per_min = 0", "20 to 250"}},
      {beat + "1" + beaten + kBall + "edge_mm = 3\n" + breath + "[[effects.breathing.region]]\n" +
           kBall + "edge_mm = 10\n",
       {"effects.breathing.amplitude_mm", "other motions"}},
      {breath + "inhale = 0.5\nexhale = 0.6\n[[effects.breathing.region]]\n" + kBall,
       {"effects.breathing.exhale", "must be at most 1"}},
      {beat + "1" + beaten + kBall + kPaperMethod, {"effects.heartbeat", "newton"}},
  };
  for (const Case& one : cases) {
    INFO(one.text);
    const std::string said = Refusal(one.text);
    for (const std::string& part : one.said) CHECK_THAT(said, Contains(part));
  }
}

// A scene that defines its wire by sections.
std::string WithSections(const TemporaryFolder& folder, const std::string& sections) {
  std::string path = folder.Path() + "/sections.toml";
  std::ofstream(path) << "name = \"sections\"\n[vessel]\nkind = \"ty_phantom\"\n"
                         "wall_stiffness_N_mm2 = 0.01\n[entry]\ncenterline = \"main\"\nat_mm = 1\n"
                         "[[instrument]]\nmax_length_mm = 200\ntip_mm = 10\n"
                      << sections;
  return path;
}

TEST_CASE("A scene's wire is the one of its sections") {
  const TemporaryFolder folder;
  const scene::Scene scene(
      WithSections(folder,
                   "from_tip_mm = [0, 10, 10, 50]\nrigidity_N_mm2 = [1, 1, 5, 45]\n"
                   "radius_mm = [0.1, 0.1, 0.2, 0.3]\ncurvature_1_per_mm = [0.05, 0.05, 0, 0]\n"
                   "curvature_2_per_mm = [0, 0.02, 0, 0]\n"));
  const WireModel& wire = scene.stack().empty_rod();
  CHECK(SectionAt(wire.sections(), 5).rigidity_N_mm2 == Approx(1));
  CHECK(SectionAt(wire.sections(), 10).rigidity_N_mm2 == Approx(1));
  CHECK(SectionAt(wire.sections(), 11).rigidity_N_mm2 == Approx(6));
  CHECK(SectionAt(wire.sections(), 30).rigidity_N_mm2 == Approx(25));
  CHECK(SectionAt(wire.sections(), 100).rigidity_N_mm2 == Approx(45));
  CHECK(wire.radius_mm(5) == Approx(0.1));
  CHECK(wire.radius_mm(30) == Approx(0.25));
  CHECK(wire.first_straight_joint() == 11);
  const double angle = std::hypot(0.05, 0.01);
  CHECK(wire.rest_direction(5)[2] == Approx(std::cos(angle)));
  CHECK(wire.rest_direction(5)[0] / wire.rest_direction(5)[1] == Approx(5));
  CHECK(scene.effects().empty());
}

TEST_CASE("Invalid sections of a wire are refused") {
  struct Case {
    std::string text;
    std::string said;
  };
  const std::string radius = "radius_mm = 0.2\n";
  const Case cases[] = {
      {"from_tip_mm = [0, 5]\nrigidity_N_mm2 = [1, 2, 3]\n" + radius, "one for each of"},
      {"from_tip_mm = [5, 0]\nrigidity_N_mm2 = [1]\n" + radius, "must increase"},
      {"from_tip_mm = [0, 5, 5, 5]\nrigidity_N_mm2 = [1]\n" + radius, "must increase"},
      {"from_tip_mm = [0, nan]\nrigidity_N_mm2 = [1]\n" + radius, "from_tip_mm"},
      {"from_tip_mm = [0]\nrigidity_N_mm2 = [-1]\n" + radius, "rigidity_N_mm2"},
      {"from_tip_mm = [0]\nrigidity_N_mm2 = [1]\n", "radius_mm: is missing"},
      {"from_tip_mm = [0]\nrigidity_N_mm2 = [1]\ncurvature_1_per_mm = [1.8]\n" + radius,
       "rest curvature"},
      {"from_tip_mm = [0]\nrigidity_N_mm2 = [1]\nradius_mm = [4.5]\n", "does not fit"},
  };
  const TemporaryFolder folder;
  for (const Case& one : cases) {
    INFO(one.text);
    const std::string path = WithSections(folder, one.text);
    CHECK_THROWS_WITH(scene::Scene(path), Contains(one.said) && Contains("sections.toml:"));
  }
}

}  // namespace
}  // namespace torquer::test
