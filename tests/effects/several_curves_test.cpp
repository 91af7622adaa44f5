// Observers of scenes whose instruments lie on several curves.
#include <Eigen/Core>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstddef>
#include <string>

#include "host/simulator/effects/observers/assessment.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"
#include "tests/effects/vascular_scene.h"
#include "tests/support/paths.h"

namespace torquer::test {
namespace {

// A second wire that begins 1 mm beside the first one, 30 mm farther in.
const std::string kBuddy = R"([[instrument]]
name = "buddy"
max_length_mm = 150
radius_mm = 0.3
rigidity_N_mm2 = 1
inserted_at_start_mm = 90
[instrument.entry]
centerline = "stem"
at_mm = 1
offset_mm = [1, 0]
)";

// A catheter around the first wire, 30 mm farther in.
const std::string kLongCatheter = R"([[instrument]]
name = "catheter"
max_length_mm = 150
radius_mm = 0.9
inner_radius_mm = 0.6
rigidity_N_mm2 = 1
inserted_at_start_mm = 90
)";

const std::string kAssessment = R"([effects.wall_force]
threshold_mN = 100
[effects.assessment]
target_centerline = "stem"
target_at_mm = 91
force_limit_mN = 1000
)";

// Moves one instrument at 100 mm/s.
void Move(simulator::Simulation& session, int instrument, double to_mm) {
  simulator::Command command;
  command.target = session.target();
  double& insertion_mm = command.target[instrument].insertion_mm;
  while (insertion_mm != to_mm) {
    insertion_mm += std::clamp(to_mm - insertion_mm, -0.5, 0.5);
    command.time_s = session.time_s() + 0.005;
    CountedBudget budget(100000);
    REQUIRE(session.Tick(command, budget).converged);
  }
}

TEST_CASE(
    "The path of the tip belongs to the assessed instrument, even if another reaches farther") {
  const std::string other =
      GENERATE(as<std::string>(), kBuddy, kLongCatheter, kLongCatheter + "[effects.clearance]\n");
  SceneOf scene(kFork + other + kAssessment);
  simulator::Simulation session(*scene);
  Move(session, 0, 95);
  CHECK(Reading(session, "tip_path_mm") == Approx(35).margin(1));
  Move(session, 0, 50);
  CHECK(Reading(session, "tip_path_mm") == Approx(80).margin(2));
  Move(session, 1, 60);
  CHECK(Reading(session, "tip_path_mm") == Approx(80).margin(2));
}

TEST_CASE("The target is reached by the assessed instrument alone") {
  const bool buddy = GENERATE(false, true);
  SceneOf scene(kFork + kBuddy + kAssessment + (buddy ? "instrument = \"buddy\"\n" : ""));
  simulator::Simulation session(*scene);
  Move(session, 0, 65);
  CHECK(Reading(session, "target_reached") == (buddy ? 1 : 0));
  Move(session, 0, 92);
  CHECK(Reading(session, "target_reached") == 1);
}

TEST_CASE("The route of an assessed instrument begins at its own entry") {
  std::string buddy = kBuddy;
  buddy.replace(buddy.find("at_mm = 1\n"), 10, "at_mm = 41\n");
  buddy.replace(buddy.find("inserted_at_start_mm = 90"), 25, "inserted_at_start_mm = 20");
  SceneOf scene(kFork + buddy + kAssessment + "instrument = \"buddy\"\n");
  simulator::Simulation session(*scene);
  Move(session, 1, 50);
  // From 61 mm to 91 mm of the centerline. The other instrument's tip rests.
  CHECK(Reading(session, "tip_path_ratio") == Approx(1).epsilon(0.05));
}

TEST_CASE("The forces at the tip are those of the tip that presses most, beside the farthest too") {
  // The first wire presses its bent tip on the wall behind the tip of a straight and longer one.
  const std::string bent = "tip_mm = 10\ntip_angle_deg = 90\n";
  std::string scene_text = kFork + bent + kBuddy + "[effects.wall_force]\nthreshold_mN = 100\n";
  SceneOf scene(scene_text);
  simulator::Simulation session(*scene);
  Move(session, 0, 61);
  const double pressed_mN = Reading(session, "wall_force_tip_mN");
  CHECK(pressed_mN > 0.5);
  CHECK(pressed_mN <= Reading(session, "wall_force_sum_mN"));
  CHECK(Reading(session, "wall_tip_pressure_kPa") > 0);
  // Beyond the tip of the other wire the same figures are those of the farthest tip.
  Move(session, 1, 50);
  CHECK(Reading(session, "wall_force_tip_mN") == Approx(pressed_mN).epsilon(0.1));
}

TEST_CASE("The case everything assesses the instrument of its task") {
  scene::Scene scene(SourcePath("/host/scenes/everything.toml"));
  for (const auto& effect : scene.effects()) {
    const auto* assessment = dynamic_cast<const effects::Assessment*>(effect.get());
    if (assessment == nullptr) continue;
    const auto assessed = static_cast<std::size_t>(assessment->task().instrument);
    CHECK(scene.instruments()[assessed].name == "microcatheter");
    return;
  }
  FAIL("no assessment");
}

TEST_CASE("Forces along a wire leave out the wall's forces on a wire beside it") {
  const std::string bent = "tip_mm = 10\ntip_angle_deg = 90\n";
  SceneOf scene(kFork + bent + kBuddy +
                "[effects.wall_force]\nthreshold_mN = 100\n[effects.internal_forces]\n");
  simulator::Simulation session(*scene);
  Move(session, 0, 61);
  // Sum of the forces' magnitudes along the curve that reaches farthest.
  const auto sum_mN = [&] {
    double sum = 0;
    for (const Eigen::Vector3d& force_N : session.forces()->contact_N) sum += 1e3 * force_N.norm();
    return sum;
  };
  CHECK(Reading(session, "wall_force_sum_mN") > 0.5);
  CHECK(sum_mN() == 0);  // the longer wire is straight
  Move(session, 1, 50);
  CHECK(sum_mN() == Approx(Reading(session, "wall_force_sum_mN")).epsilon(0.01));
}

}  // namespace
}  // namespace torquer::test
