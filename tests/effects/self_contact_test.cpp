// Self contact, as scenes use it: a wire that is fed into a sac, readings, and repeatable sessions.
#include <Eigen/Core>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <fstream>
#include <string>

#include "host/simulator/simulation.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {
namespace {

using Eigen::Vector3d;

// A tube that widens to a sac with a blind end.
constexpr char kSac[] =
    "name = \"sac\"\n[vessel]\nkind = \"tubes\"\nwall_stiffness_N_mm2 = 0.05\n"
    "[[vessel.tube]]\nname = \"main\"\npoints_mm = [[0, 0, 0], [0, 0, 20], [0, 0, 37], [0, 0, "
    "44]]\n"
    "radii_mm = [1.5, 1.5, 5, 5]\n"
    "[entry]\ncenterline = \"main\"\nat_mm = 2\n"
    "[[instrument]]\nmax_length_mm = 200\nradius_mm = 0.2\nrigidity_N_mm2 = 0.006\n"
    "inserted_at_start_mm = 10\n[relaxation]\nsegment_mm = 1\n";
constexpr double kRadiusOfWireMm = 0.2;

// Least distance of the axis of a curve to itself, beyond neighbors.
double NearestItselfMm(const std::vector<Vector3d>& nodes) {
  double least_mm = 1e9;
  for (std::size_t i = 0; i + 6 < nodes.size(); ++i) {
    for (std::size_t m = i + 5; m + 1 < nodes.size(); ++m) {
      for (double along = 0; along < 1; along += 0.1) {
        const Vector3d at = nodes[i] + along * (nodes[i + 1] - nodes[i]);
        const Vector3d way = nodes[m + 1] - nodes[m];
        const double on = std::clamp((at - nodes[m]).dot(way) / way.squaredNorm(), 0.0, 1.0);
        least_mm = std::min(least_mm, (at - nodes[m] - on * way).norm());
      }
    }
  }
  return least_mm;
}

std::string WriteSac(const TemporaryFolder& folder, const std::string& effects) {
  std::string path = folder.Path("sac.toml");
  std::ofstream(path) << kSac << effects;
  return path;
}

// Feeds the wire from its start, 0.5 mm a tick, turning it.
void FeedIntoSac(simulator::Simulation& simulation, const scene::Scene& scene, int from, int to) {
  for (int k = from; k <= to; ++k) {
    simulator::Command command;
    command.target = scene.start();
    command.target[0].insertion_mm += 0.5 * k;
    command.target[0].rotation_rad += 0.02 * k;
    command.time_s = 0.02 * k;
    CountedBudget budget(2000);
    CHECK(simulation.Tick(command, budget).converged);
  }
}

double Reading(const simulator::Simulation& simulation, const std::string& name) {
  for (const effects::Reading& reading : simulation.Readings()) {
    if (reading.name == name) return reading.value;
  }
  FAIL("no reading " << name);
  return 0;
}

constexpr char kItself[] = "[effects.self_contact]\n";

TEST_CASE("A wire that is fed into a sac lies around itself, and passes through itself without") {
  const TemporaryFolder folder;
  constexpr int kFeeds = Rounds(190, 60);
  const bool touches = GENERATE(true, false);
  scene::Scene scene(WriteSac(folder, touches ? kItself : ""));
  simulator::Simulation simulation(scene);
  FeedIntoSac(simulation, scene, 1, kFeeds);
  const double nearest_mm = NearestItselfMm(simulation.state().nodes());
  CAPTURE(touches, nearest_mm);
  if (kUnderSanitizer) return;
  if (!touches) {
    CHECK(nearest_mm < kRadiusOfWireMm);
    return;
  }
  CHECK(nearest_mm > 2 * kRadiusOfWireMm - 0.03);
  CHECK(Reading(simulation, "self_contact_force_sum_mN") > 0.01);
}

TEST_CASE("With contact with itself a scene repeats, restarts and is copied to the bit") {
  const TemporaryFolder folder;
  const std::string more = GENERATE(as<std::string>(), "", "[effects.torsion]\n",
                                    "[effects.torsion]\n[effects.friction_between]\n"
                                    "coefficient = 0.15\n");
  scene::Scene scene(WriteSac(folder, kItself + more + "[effects.friction]\ncoefficient = 0.1\n"));
  simulator::Simulation simulation(scene);
  constexpr int kTicks = Rounds(170, 20);
  constexpr int kBefore = 3 * kTicks / 4;
  FeedIntoSac(simulation, scene, 1, kTicks);
  const std::uint64_t hash = simulation.state_hash();
  simulation.Restart();
  CHECK(Reading(simulation, "self_contact_force_sum_mN") == 0);
  FeedIntoSac(simulation, scene, 1, kBefore);
  const auto twin_scene = scene.MakeTwin();
  simulator::Simulation copy(*twin_scene, simulation);
  FeedIntoSac(simulation, scene, kBefore + 1, kTicks);
  FeedIntoSac(copy, *twin_scene, kBefore + 1, kTicks);
  CHECK(simulation.state_hash() == hash);
  CHECK(copy.state_hash() == hash);
}

// A wire that rests as a ring leaves its catheter in a wide vessel. The ring closes on the
// catheter.
constexpr char kRing[] =
    "name = \"ring\"\n[vessel]\nkind = \"tubes\"\nwall_stiffness_N_mm2 = 1\n"
    "[[vessel.tube]]\nname = \"main\"\npoints_mm = [[0, 0, 0], [0, 0, 80]]\nradii_mm = [15]\n"
    "[entry]\ncenterline = \"main\"\nat_mm = 5\n"
    "[[instrument]]\nname = \"wire\"\nmax_length_mm = 120\nradius_mm = 0.2\n"
    "rigidity_N_mm2 = 0.05\ninserted_at_start_mm = 32\nfrom_tip_mm = [0, 30, 31]\n"
    "curvature_1_per_mm = [0.25, 0.25, 0]\n"
    "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 100\nradius_mm = 0.6\n"
    "inner_radius_mm = 0.25\nrigidity_N_mm2 = 20\ninserted_at_start_mm = 30\n"
    "[relaxation]\nsegment_mm = 0.75\n[effects.clearance]\naround = [\"catheter\"]\n";

TEST_CASE("A wire that curls back presses on the outside of its catheter") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("ring.toml");
  const std::string friction = GENERATE(
      as<std::string>(), "", "[effects.torsion]\n[effects.friction_between]\ncoefficient = 0.1\n");
  std::ofstream(path) << kRing << kItself << friction;
  scene::Scene scene(path);
  simulator::Simulation simulation(scene);
  FeedIntoSac(simulation, scene, 1, 36);
  // The ring would reach the catheter after 0.9 of a turn, 22.5 mm.
  CHECK(Reading(simulation, "self_contact_force_sum_mN") == 0);
  const auto twin_scene = scene.MakeTwin();
  simulator::Simulation copy(*twin_scene, simulation);
  FeedIntoSac(simulation, scene, 37, 50);
  FeedIntoSac(copy, *twin_scene, 37, 50);
  CHECK(Reading(simulation, "self_contact_force_sum_mN") > 0.02);
  CHECK(copy.state_hash() == simulation.state_hash());
}

TEST_CASE("The paper's method refuses contact with itself") {
  const TemporaryFolder folder;
  const std::string path = WriteSac(folder, "method = \"paper\"\n" + std::string(kItself));
  CHECK_THROWS_WITH(scene::Scene(path), Catch::Contains("sac.toml") &&
                                            Catch::Contains("self_contact") &&
                                            Catch::Contains("newton"));
}

}  // namespace
}  // namespace torquer::test
