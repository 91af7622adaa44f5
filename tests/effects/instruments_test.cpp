// Several instruments in a scene: their keys, hands, messages, dye and X-ray.
#include <catch2/catch.hpp>
#include <fstream>

#include "host/simulator/effects/blood/contrast.h"
#include "host/simulator/effects/imaging/fluoroscopy.h"
#include "host/simulator/simulation.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {
namespace {

using Catch::Contains;
using simulator::Simulation;

constexpr char kWire[] =
    "[[instrument]]\nmax_length_mm = 200\nradius_mm = 0.2\nrigidity_N_mm2 = 2\n"
    "inserted_at_start_mm = 60\n";
constexpr char kCatheter[] =
    "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\ninserted_at_start_mm = 40\n"
    "inner_radius_mm = 0.3\nradius_mm = 0.5\nrigidity_N_mm2 = 3\n";
constexpr char kSheath[] =
    "[[instrument]]\nname = \"sheath\"\nmax_length_mm = 100\ninserted_at_start_mm = 20\n"
    "inner_radius_mm = 0.7\nradius_mm = 0.9\nrigidity_N_mm2 = 8\n";

std::string WriteScene(const TemporaryFolder& folder, const std::string& instruments,
                       const std::string& more = "") {
  std::string path = folder.Path("instruments.toml");
  std::ofstream(path) << "name = \"instruments\"\n[vessel]\nkind = \"ty_phantom\"\n"
                         "wall_stiffness_N_mm2 = 0.5\n"
                         "[entry]\ncenterline = \"main\"\nat_mm = 1\n"
                      << instruments << more;
  return path;
}

void Go(Simulation& simulation, const InstrumentPoses& target) {
  for (int k = 0; k < 50; ++k) {
    simulator::Command command;
    command.target = target;
    CountedBudget budget(10000);
    if (simulation.Tick(command, budget).converged) break;
  }
}

TEST_CASE("Friction between instruments is refused for a single instrument") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("alone.toml");
  std::ofstream(path) << "name = \"alone\"\n[vessel]\nkind = \"ty_phantom\"\n"
                         "wall_stiffness_N_mm2 = 0.05\n[entry]\ncenterline = \"main\"\nat_mm = 1\n"
                         "[[instrument]]\nmax_length_mm = 150\nradius_mm = 0.2\n"
                         "rigidity_N_mm2 = 0.01\n[effects.friction_between]\ncoefficient = 0.1\n";
  CHECK_THROWS_WITH(scene::Scene(path), Catch::Contains("effects.friction_between.coefficient") &&
                                            Catch::Contains("one instrument"));
  std::ofstream(path, std::ios::app) << "[effects.self_contact]\n";
  CHECK_NOTHROW(scene::Scene(path));
}

TEST_CASE("Each instrument of a scene starts, moves and is reported by its name") {
  const TemporaryFolder folder;
  scene::Scene scene(WriteScene(folder, std::string(kWire) + kCatheter + kSheath));
  REQUIRE(scene.stack().size() == 3);
  Simulation simulation(scene);
  torquer_lcm::wire_state_t state;
  simulation.Describe(state);
  REQUIRE(state.instruments.size() == 3);
  CHECK(state.instruments[0].name == "guidewire");
  CHECK(state.instruments[1].name == "catheter");
  CHECK(state.instruments[2].name == "sheath");
  CHECK(state.instruments[0].insertion_mm == 60);
  CHECK(state.instruments[1].insertion_mm == 40);
  CHECK(state.instruments[2].insertion_mm == 20);
  CHECK(state.node_count == 61);

  Go(simulation, {{70, 0.5}, {85, 1}, {30, -2}});  // catheter beyond the wire
  simulation.Describe(state);
  CHECK(state.instruments[0].insertion_mm == Approx(70));
  CHECK(state.instruments[1].commanded_insertion_mm == 85);
  CHECK(state.instruments[1].commanded_rotation_rad == 1);
  CHECK(state.instruments[1].insertion_mm == Approx(85));
  CHECK(state.instruments[1].rotation_rad == 1);
  CHECK(state.instruments[2].insertion_mm == Approx(30));
  CHECK(state.instruments[2].rotation_rad == -2);
  CHECK(simulation.state().insertion_mm() == Approx(85));
  // The instruments are nested on one curve: each tip lies on it at its own insertion.
  for (const torquer_lcm::instrument_state_t& instrument : state.instruments) {
    INFO(instrument.name);
    const Eigen::Vector3d tip(instrument.tip_mm[0], instrument.tip_mm[1], instrument.tip_mm[2]);
    const Eigen::Vector3d on_curve =
        PointAt(scene.stack().empty_rod(), simulation.state(), instrument.insertion_mm);
    CHECK((tip - on_curve).norm() < 1e-9);
  }
  // Targets out of range stop at the entry and at the instrument's length.
  Go(simulation, {{70, 0.5}, {-10, 1}, {500, 0}});
  simulation.Describe(state);
  CHECK(state.instruments[1].insertion_mm == 0);
  CHECK(state.instruments[2].insertion_mm == 100);
}

TEST_CASE("Dye from an instrument's tip is dye from that place of the vessel") {
  const TemporaryFolder folder;
  const std::string flow = "[effects.flow]\ninlet = \"main\"\ninlet_mL_s = 5\n";
  const auto inject = [&](const std::string& more) {
    scene::Scene scene(WriteScene(folder, std::string(kWire) + kCatheter,
                                  flow + "[effects.contrast]\nrate_mL_s = 2\n" + more));
    Simulation simulation(scene);
    for (int k = 0; k < 100; ++k) {
      simulator::Command command;
      command.target = simulation.target();
      command.controls.contrast = true;
      CountedBudget budget(100);
      simulation.Tick(command, budget);
    }
    for (const auto& effect : scene.effects()) {
      if (const auto* contrast = dynamic_cast<const effects::Contrast*>(effect.get())) {
        return contrast->concentration_mg_mL();
      }
    }
    return std::vector<double>();
  };
  const std::vector<double> from_tip = inject("at = \"tip\"\ninstrument = \"catheter\"\n");
  REQUIRE_FALSE(from_tip.empty());
  CHECK(from_tip == inject("at = \"place\"\ncenterline = \"main\"\nat_mm = 41\n"));
  CHECK(from_tip != inject("at = \"tip\"\ninstrument = \"guidewire\"\n"));
}

// Gray values of a picture of the wire and `more`, without a body around them.
std::vector<std::uint8_t> Picture(const TemporaryFolder& folder, const std::string& more) {
  scene::Scene scene(
      WriteScene(folder, kWire + more,
                 "[effects.fluoroscopy]\nbody_width_mm = 0\nphotons = 1e6\ndetector_mm = 100\n"
                 "isocenter_mm = [40, 0, 0]\n"));
  Simulation simulation(scene);
  simulator::Command command;
  command.target = simulation.target();
  command.controls.xray = true;
  CountedBudget budget(100);
  simulation.Tick(command, budget);
  REQUIRE(simulation.picture_due());
  effects::ImageSource::Picture picture;
  simulation.image()->Render(picture);
  return picture.gray;
}

TEST_CASE("X-rays see the catheter's wall and the wire in it") {
  const TemporaryFolder folder;
  const auto dark = [&](const std::string& more) {
    double sum = 0;
    for (const std::uint8_t gray : Picture(folder, more)) sum += 255 - gray;
    return sum;
  };
  const double alone = dark("");
  // A thinner wall absorbs less, because the lumen is empty.
  std::string thin = kCatheter;
  thin.replace(thin.find("inner_radius_mm = 0.3"), 21, "inner_radius_mm = 0.48");
  CHECK(dark(kCatheter) > dark(thin) + 1e4);
  CHECK(dark(thin) > alone);
  CHECK(dark(kCatheter) > alone + 2e4);
  CHECK(dark(std::string(kCatheter) + kSheath) > dark(kCatheter) + 1e4);
}

TEST_CASE("A marker of no length is not in the picture, and one with a length is") {
  const TemporaryFolder folder;
  const auto picture = [&](const std::string& marker) { return Picture(folder, marker); };
  CHECK(picture("marker_mm = 0\nmarker_1_mm = 20\n") == picture(""));
  CHECK(picture("marker_mm = 3\nmarker_1_mm = 20\n") != picture(""));
}

TEST_CASE("Impossible instruments are refused with the remedy") {
  const TemporaryFolder folder;
  const auto refuses = [&](const std::string& instruments, const std::string& more,
                           const std::string& place, const std::string& remedy) {
    INFO(instruments << more);
    CHECK_THROWS_WITH(scene::Scene(WriteScene(folder, kWire + instruments, more)),
                      Contains(place) && Contains(remedy));
  };
  const std::string some =
      "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\nrigidity_N_mm2 = 3\n";
  refuses(some + "radius_mm = 0.5\ninner_radius_mm = 0.2\n", "", "inner_radius_mm", "guidewire");
  refuses(some + "radius_mm = 0.5\ninner_radius_mm = 0.5\n", "", "inner_radius_mm", "radius_mm");
  refuses(some + "radius_mm = 0.5\n", "", "inner_radius_mm", "guidewire");
  refuses(some + "radius_mm = 0.5\ninner_radius_mm = 0.3\ninserted_at_start_mm = 151\n", "",
          "inserted_at_start_mm", "max_length_mm");
  refuses(some + "radius_mm = 0.5\ninner_radius_mm = 0.3\ntip_angle_deg = 30\n", "", "instrument",
          "tip_mm");
  refuses(
      "[[instrument]]\nmax_length_mm = 150\nrigidity_N_mm2 = 3\nradius_mm = 0.5\n"
      "inner_radius_mm = 0.3\n",
      "", "name", "another instrument of this scene has this name");
  refuses(kCatheter, "[relaxation]\nmethod = \"paper\"\n", "method", "newton");
  refuses("",
          "[effects.flow]\ninlet = \"main\"\ninlet_mL_s = 5\n[effects.contrast]\n"
          "rate_mL_s = 2\nat = \"tip\"\ninstrument = \"catheter\"\n",
          "effects.contrast.instrument", "guidewire");
  const std::string third = std::string(kCatheter) + kSheath;
  refuses(third +
              "[[instrument]]\nname = \"a\"\nmax_length_mm = 90\ninner_radius_mm = 1\n"
              "radius_mm = 1.1\nrigidity_N_mm2 = 3\n[[instrument]]\nname = \"b\"\n"
              "max_length_mm = 90\ninner_radius_mm = 1.2\nradius_mm = 1.3\nrigidity_N_mm2 = 3\n",
          "", "instrument", "4");
}

TEST_CASE("An instrument by sections is the one of its table") {
  const TemporaryFolder folder;
  scene::Scene scene(WriteScene(
      folder, std::string(kWire) +
                  "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\n"
                  "inner_radius_mm = 0.3\nfrom_tip_mm = [0, 20, 60]\nrigidity_N_mm2 = [1, 5, 9]\n"
                  "radius_mm = [0.4, 0.5, 0.5]\ncurvature_1_per_mm = [0.1, 0, 0]\n"));
  const WireModel& catheter = scene.stack().instrument(1);
  CHECK(SectionAt(catheter.sections(), 40).rigidity_N_mm2 == Approx(7));
  CHECK(SectionAt(catheter.sections(), 10).curvature_1_per_mm == Approx(0.05));
  CHECK(catheter.radius_mm(10) == Approx(0.45));
  CHECK(catheter.first_straight_joint() == 21);
}

}  // namespace
}  // namespace torquer::test
