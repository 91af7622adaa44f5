// The effect catheter as a scene has it: its keys, its input, its messages, dye and X-ray.
#include <catch2/catch.hpp>
#include <fstream>

#include "host/simulator/effects/contrast.h"
#include "host/simulator/effects/fluoroscopy.h"
#include "host/simulator/session.h"
#include "protocol/lcm_channels.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {
namespace {

using Catch::Contains;
using simulator::Session;

constexpr char kCatheter[] =
    "[effects.catheter]\nmax_length_mm = 150\ninserted_at_start_mm = 40\ninner_radius_mm = 0.3\n"
    "radius_mm = 0.5\nrigidity_N_mm2 = 3\n";

std::string SceneFile(const TemporaryFolder& folder, const std::string& effects) {
  std::string path = folder.Path("catheter.toml");
  std::ofstream(path) << "name = \"catheter\"\n[vessel]\nkind = \"phantom\"\nphantom = \"ty\"\n"
                         "wall_stiffness_N_mm2 = 0.5\n"
                         "[entry]\ncenterline = \"main\"\nat_mm = 1\n"
                         "[wire]\nsegment_mm = 1\nmax_length_mm = 200\nradius_mm = 0.2\n"
                         "rigidity_N_mm2 = 2\ninserted_at_start_mm = 60\n"
                      << effects;
  return path;
}

void Go(Session& session, const HandTarget& target) {
  for (int k = 0; k < 50; ++k) {
    simulator::Command command;
    command.target = target;
    CountedBudget budget(10000);
    if (session.Tick(command, budget).converged) break;
  }
}

TEST_CASE("A scene's catheter starts, moves and is told of as its own instrument") {
  const TemporaryFolder folder;
  scene::Scene scene(SceneFile(folder, kCatheter));
  REQUIRE(scene.coaxial() != nullptr);
  Session session(scene);
  torquer_lcm::wire_state_t wire;
  torquer_lcm::wire_state_t catheter;
  session.Describe(wire);
  REQUIRE(session.DescribeCatheter(catheter));
  CHECK(wire.instrument == protocol::kGuidewire);
  CHECK(wire.insertion_mm == 60);
  CHECK(catheter.instrument == protocol::kCatheter);
  CHECK(catheter.insertion_mm == 40);
  CHECK(catheter.node_count == 41);
  CHECK(wire.node_count == 61);

  Go(session, {70, 0.5, 85, 1});  // beyond the wire
  session.Describe(wire);
  session.DescribeCatheter(catheter);
  CHECK(wire.insertion_mm == Approx(70));
  CHECK(wire.commanded_catheter_insertion_mm == 85);
  CHECK(wire.commanded_catheter_rotation_rad == 1);
  CHECK(catheter.insertion_mm == Approx(85));
  CHECK(catheter.rotation_rad == 1);
  CHECK(session.state().insertion_mm == Approx(85));
  // One in the other, on one line.
  const Eigen::Vector3d tip(wire.tip_mm[0], wire.tip_mm[1], wire.tip_mm[2]);
  double nearest = 1e9;
  for (const std::vector<float>& x : catheter.nodes_mm) {
    const Eigen::Vector3d node = Eigen::Vector3f(x[0], x[1], x[2]).cast<double>();
    nearest = std::min(nearest, (node - tip).norm());
  }
  CHECK(nearest < 1);
  // Commanded out of the body, it stops at the sheath, and at its length.
  Go(session, {70, 0.5, -10, 1});
  session.DescribeCatheter(catheter);
  CHECK(catheter.insertion_mm == 0);
  Go(session, {70, 0.5, 400, 1});
  session.DescribeCatheter(catheter);
  CHECK(catheter.insertion_mm == 150);
}

TEST_CASE("A scene without a catheter tells of none, whatever a command says") {
  const TemporaryFolder folder;
  scene::Scene scene(SceneFile(folder, ""));
  Session session(scene);
  const std::uint64_t before = session.state_hash();
  Go(session, {60, 0, 50, 1});
  torquer_lcm::wire_state_t state;
  CHECK_FALSE(session.DescribeCatheter(state));
  CHECK(session.state_hash() == before);
}

TEST_CASE("Dye from the catheter's tip is dye from that place of the vessel") {
  const TemporaryFolder folder;
  const std::string flow = "[effects.flow]\ninlet = \"main\"\ninlet_mL_s = 5\n";
  const auto inject = [&](const std::string& more) {
    scene::Scene scene(
        SceneFile(folder, kCatheter + flow + "[effects.contrast]\nrate_mL_s = 2\n" + more));
    Session session(scene);
    for (int k = 0; k < 100; ++k) {
      simulator::Command command;
      command.target = {60, 0, 40, 0};
      command.controls.contrast = true;
      CountedBudget budget(100);
      session.Tick(command, budget);
    }
    for (const auto& effect : scene.effects()) {
      if (const auto* contrast = dynamic_cast<const effects::Contrast*>(effect.get())) {
        return contrast->concentration_mg_mL();
      }
    }
    return std::vector<double>();
  };
  const std::vector<double> from_tip = inject("at = \"catheter\"\n");
  REQUIRE_FALSE(from_tip.empty());
  CHECK(from_tip == inject("at = \"place\"\ncenterline = \"main\"\nat_mm = 41\n"));
  CHECK(from_tip != inject("at = \"tip\"\n"));
}

TEST_CASE("X-rays see the catheter's wall and the wire in it") {
  const TemporaryFolder folder;
  const auto dark = [&](const std::string& more) {
    scene::Scene scene(SceneFile(
        folder, more +
                    "[effects.fluoroscopy]\nbody_width_mm = 0\nphotons = 1e6\ndetector_mm = 100\n"
                    "isocenter_mm = [40, 0, 0]\n"));
    Session session(scene);
    simulator::Command command;
    command.target = session.target();
    command.controls.xray = true;
    CountedBudget budget(100);
    session.Tick(command, budget);
    REQUIRE(session.picture_due());
    effects::ImageSource::Picture picture;
    session.image()->Render(picture);
    double sum = 0;
    for (const std::uint8_t gray : picture.gray) sum += 255 - gray;
    return sum;
  };
  const double alone = dark("");
  // A thinner wall casts less of a shadow: the lumen is empty.
  std::string thin = kCatheter;
  thin.replace(thin.find("inner_radius_mm = 0.3"), 21, "inner_radius_mm = 0.48");
  CHECK(dark(kCatheter) > dark(thin) + 1e4);
  CHECK(dark(thin) > alone);
  CHECK(dark(kCatheter) > alone + 2e4);
}

TEST_CASE("What a catheter cannot be is refused, with the remedy") {
  const TemporaryFolder folder;
  const auto refuses = [&](const std::string& effects, const std::string& place,
                           const std::string& remedy) {
    INFO(effects);
    CHECK_THROWS_WITH(scene::Scene(SceneFile(folder, effects)),
                      Contains(place) && Contains(remedy));
  };
  const std::string some = "[effects.catheter]\nmax_length_mm = 150\nrigidity_N_mm2 = 3\n";
  refuses(some + "radius_mm = 0.5\ninner_radius_mm = 0.2\n", "effects.catheter.inner_radius_mm",
          "more than the wire's radius");
  refuses(some + "radius_mm = 0.5\ninner_radius_mm = 0.5\n", "effects.catheter.inner_radius_mm",
          "less than the outer radius");
  refuses(some + "radius_mm = 0.5\n", "effects.catheter", "inner_radius_mm");
  refuses(some + "radius_mm = 0.5\ninner_radius_mm = 0.3\ninserted_at_start_mm = 151\n",
          "effects.catheter.inserted_at_start_mm", "max_length_mm");
  refuses(some + "radius_mm = 0.5\ninner_radius_mm = 0.3\ntip_angle_deg = 30\n",
          "effects.catheter.tip_mm", "at least a segment");
  refuses(std::string(kCatheter) + "[effects.torsion]\n", "effects.catheter", "effects.torsion");
  refuses(std::string(kCatheter) + "[relaxation]\nmethod = \"paper\"\n", "effects.catheter",
          "newton");
  refuses("[effects.fluoroscopy]\ncatheter_1_mm = 1\n", "effects.fluoroscopy.catheter_1_mm",
          "effects.catheter");
  refuses(
      "[effects.flow]\ninlet = \"main\"\ninlet_mL_s = 5\n"
      "[effects.contrast]\nrate_mL_s = 2\nat = \"catheter\"\n",
      "effects.contrast.at", "effects.catheter");
}

TEST_CASE("A catheter by sections is the one of its table") {
  const TemporaryFolder folder;
  scene::Scene scene(SceneFile(
      folder,
      "[effects.catheter]\nmax_length_mm = 150\ninner_radius_mm = 0.3\nfrom_tip_mm = [0, 20, 60]\n"
      "rigidities_N_mm2 = [1, 5, 9]\nradii_mm = [0.4, 0.5, 0.5]\ncurvatures_1_per_mm = [0.1, 0, "
      "0]\n"));
  const WireModel& catheter = scene.coaxial()->catheter();
  CHECK(catheter.rigidity_N_mm2(40) == Approx(7));
  CHECK(catheter.radius_mm(10) == Approx(0.45));
  CHECK(catheter.first_straight_joint() == 20);
}

}  // namespace
}  // namespace torquer::test
