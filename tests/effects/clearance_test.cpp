// Clearance in a lumen, as scenes use it: keys, tips, pictures, and repeatable sessions.
#include <catch2/catch.hpp>
#include <fstream>

#include "host/simulator/simulation.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {
namespace {

using Catch::Contains;

constexpr char kRoomScene[] =
    "name = \"room\"\n[vessel]\nkind = \"ty_phantom\"\nwall_stiffness_N_mm2 = 0.5\n"
    "[entry]\ncenterline = \"main\"\nat_mm = 1\n"
    "[[instrument]]\nmax_length_mm = 200\nradius_mm = 0.2\nrigidity_N_mm2 = 0.02\n"
    "tip_mm = 10\ntip_angle_deg = 30\ninserted_at_start_mm = 110\n";
constexpr char kWideCatheter[] =
    "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\ninserted_at_start_mm = 90\n"
    "inner_radius_mm = 0.6\nradius_mm = 0.8\nrigidity_N_mm2 = 0.05\n";
constexpr char kRoom[] = "[effects.clearance]\n";

std::string WriteRoom(const TemporaryFolder& folder, const std::string& text) {
  std::string path = folder.Path("room.toml");
  std::ofstream(path) << text;
  return path;
}

simulator::Command Push(const scene::Scene& scene, int k) {
  simulator::Command command;
  command.target = scene.start();
  command.target[0].insertion_mm += 0.4 * k;
  command.target[0].rotation_rad += 0.05 * k;
  if (k > 20) command.target[1].insertion_mm += 1.8 * (k - 20);
  command.time_s = 0.02 * k;
  command.controls.xray = true;
  return command;
}

TEST_CASE("Room is refused for instruments without a lumen") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& text, const std::string& what) {
    CHECK_THROWS_WITH(scene::Scene(WriteRoom(folder, text)),
                      Contains("room.toml") && Contains("clearance") && Contains(what));
  };
  const std::string both = std::string(kRoomScene) + kWideCatheter;
  CHECK_NOTHROW(scene::Scene(WriteRoom(folder, both + kRoom)));
  CHECK_NOTHROW(scene::Scene(WriteRoom(folder, both + kRoom + "around = \"catheter\"\n")));
  refused(std::string(kRoomScene) + kRoom, "one instrument");
  refused(both + kRoom + "around = \"guidewire\"\n", "innermost");
  refused(both + kRoom + "around = \"sheath\"\n", "this scene has: guidewire, catheter");
  CHECK_NOTHROW(scene::Scene(WriteRoom(folder, both + kRoom + "around = [\"catheter\"]\n")));
  refused(both + kRoom + "around = [\"catheter\", \"sheath\"]\n", "this scene has");
  refused(both + kRoom + "around = []\n", "list of texts");
  refused(both + kRoom + "around = [\"catheter\", 3]\n", "holds 3");
  refused(both + kRoom + "around = 3\n", "list of texts");
}

TEST_CASE("With room a scene repeats, restarts and is copied to the bit") {
  const TemporaryFolder folder;
  const std::string path = WriteRoom(folder, std::string(kRoomScene) + kWideCatheter + kRoom +
                                                 "[effects.friction]\ncoefficient = 0.1\n");
  scene::Scene scene(path);
  simulator::Simulation simulation(scene);
  const auto run = [&](simulator::Simulation& one, int from, int to) {
    for (int k = from; k <= to; ++k) {
      CountedBudget budget(1000);
      CHECK(one.Tick(Push(scene, k), budget).converged);
    }
    return one.state_hash();
  };
  constexpr int kTicks = Rounds(50, 3);
  constexpr int kBefore = 3 * kTicks / 5;
  const std::uint64_t hash = run(simulation, 1, kTicks);
  if (!kUnderSanitizer) CHECK(simulation.state().FarthestCurve() == 1);
  simulation.Restart();
  run(simulation, 1, kBefore);
  const auto twin_scene = scene.MakeTwin();
  simulator::Simulation copy(*twin_scene, simulation);
  CHECK(run(simulation, kBefore + 1, kTicks) == hash);
  CHECK(run(copy, kBefore + 1, kTicks) == hash);
}

TEST_CASE("Tips with room are on their own curves, and readings show their positions") {
  const TemporaryFolder folder;
  scene::Scene scene(WriteRoom(folder, std::string(kRoomScene) + kWideCatheter + kRoom));
  simulator::Simulation simulation(scene);
  for (int k = 1; k <= 20; ++k) {
    CountedBudget budget(1000);
    simulation.Tick(Push(scene, k), budget);
  }
  torquer_lcm::wire_state_t message;
  simulation.Describe(message);
  const auto tip = [&](int k) {
    const double* const at = message.instruments[static_cast<std::size_t>(k)].tip_mm;
    return Eigen::Vector3d(at[0], at[1], at[2]);
  };
  const WireState& state = simulation.state();
  CHECK((tip(0) - state.tip()).norm() < 1e-9);
  // The catheter's mouth is on its own curve; the wire passes through it off center.
  const double arc_mm = state.poses()[1].insertion_mm;
  const Eigen::Vector3d mouth = PointAt(scene.stack().empty_rod(), state.curve(1), arc_mm);
  CHECK((tip(1) - mouth).norm() < 1e-9);
  const double off_mm = (mouth - PointAt(scene.stack().empty_rod(), state, arc_mm)).norm();
  double sum_mN = 0;
  double end_mN = 0;
  double offset_mm = 0;
  for (const effects::Reading& reading : simulation.Readings()) {
    if (reading.name == "lumen_force_sum_mN") sum_mN = reading.value;
    if (reading.name == "lumen_force_end_mN") end_mN = reading.value;
    if (reading.name == "lumen_offset_mm") offset_mm = reading.value;
  }
  CAPTURE(off_mm, sum_mN, end_mN, offset_mm);
  CHECK(off_mm > 0.3);
  CHECK(off_mm < 0.45);
  CHECK(offset_mm >= off_mm - 0.05);
  CHECK(offset_mm < 0.42);
  CHECK(end_mN > 0);
  CHECK(sum_mN > end_mN);
}

}  // namespace
}  // namespace torquer::test
