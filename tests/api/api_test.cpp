// Tests of torquer.h as a program outside this tree uses it.
#include <torquer/torquer.h>

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;
using torquer::Command;
using torquer::Scene;
using torquer::Simulation;
using torquer::test::kUnderSanitizer;

const std::string kScenes = torquer::test::SourcePath("/host/scenes");

/// Everything that a simulation exposes.
struct Shown {
  std::uint64_t hash = 0;
  std::vector<double> nodes_mm;
  std::vector<double> numbers;
  std::vector<std::string> names;
  std::vector<std::uint64_t> readings;  // their bits, because an unknown value is NaN
  std::vector<std::uint8_t> gray;

  bool operator==(const Shown&) const = default;
};

bool HasEffect(const Scene& scene, const std::string& name) {
  const std::vector<std::string> effects = scene.effects();
  return std::find(effects.begin(), effects.end(), name) != effects.end();
}

Shown Show(Simulation& simulation) {
  Shown shown;
  shown.hash = simulation.state_hash();
  shown.nodes_mm.assign(simulation.nodes_mm(), simulation.nodes_mm() + 3 * simulation.node_count());
  shown.numbers = {simulation.time_s(), simulation.energy_mJ(), simulation.residual(),
                   simulation.max_penetration_mm(), simulation.dissipated_mJ()};
  for (const torquer::Contact& contact : simulation.contacts()) {
    shown.numbers.push_back(contact.penetration_mm);
  }
  for (const torquer::InstrumentState& instrument : simulation.instruments()) {
    for (const double tip_mm : instrument.tip_mm) shown.numbers.push_back(tip_mm);
    shown.numbers.push_back(instrument.hand.insertion_mm);
    shown.numbers.push_back(instrument.carried.rotation_rad);
  }
  for (const torquer::Reading& reading : simulation.readings()) {
    shown.names.push_back(reading.name);
    shown.readings.push_back(std::bit_cast<std::uint64_t>(reading.value));
  }
  if (HasEffect(simulation.scene(), "internal_forces")) {
    for (const torquer::Point& force : simulation.forces().contact_mN) {
      shown.numbers.insert(shown.numbers.end(), force.begin(), force.end());
    }
  }
  if (HasEffect(simulation.scene(), "fluoroscopy")) shown.gray = simulation.LastPicture().gray;
  return shown;
}

/// Random hand motion from a seed; on average the wire is fed in.
class Wanderer {
 public:
  explicit Wanderer(unsigned seed) : random_(seed) {}
  Command Next(const Command& before) {
    Command next = before;
    next.time_s += 0.02;
    for (torquer::Hand& hand : next.hands) {
      hand.insertion_mm = std::max(0.0, hand.insertion_mm + Uniform(-0.5, 1));
      hand.rotation_rad += Uniform(-0.2, 0.2);
    }
    next.xray = true;
    next.contrast = Uniform(0, 1) < 0.5;
    return next;
  }

 private:
  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  std::mt19937 random_;
};

void Wander(Simulation& simulation, Wanderer& hands, int steps) {
  for (int k = 0; k < steps; ++k) simulation.Step(hands.Next(simulation.command()));
}

/// Scenes that together have every effect, every kind of vessel and three instruments.
std::vector<std::string> SceneFiles() {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(kScenes)) {
    if (entry.path().extension() == ".toml") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// All of these scenes; under a sanitizer every second one, from `first` on.
std::vector<std::string> SomeSceneFiles(std::size_t first) {
  std::vector<std::string> files = SceneFiles();
  if (!kUnderSanitizer) return files;
  std::vector<std::string> some;
  for (std::size_t k = first; k < files.size(); k += 2) some.push_back(files[k]);
  return some;
}

/// A shipped scene with keys added after a heading.
Scene ShippedWith(const std::string& name, const std::string& heading, const std::string& keys) {
  std::ifstream in(kScenes + "/" + name + ".toml");
  std::string text(std::istreambuf_iterator<char>(in), {});
  const std::size_t at = text.find(heading);
  REQUIRE(at != std::string::npos);
  text.insert(at + heading.size(), keys);
  return Scene::FromText(text, kScenes);
}

/// Copies a simulation repeatedly during a run; the copy and the original must stay equal.
void CheckCopiesOnTheWay(const Scene& scene, int copies) {
  Simulation simulation(scene);
  Wanderer hands(5);
  for (int k = 0; k < copies; ++k) {
    Simulation copy = simulation;
    Wanderer same = hands;
    Wander(simulation, hands, 1 + k % 3);
    Wander(copy, same, 1 + k % 3);
    REQUIRE(Show(copy) == Show(simulation));
  }
}

}  // namespace

TEST_CASE("A scene of the working folder is named by its file alone", "[api]") {
  const torquer::test::SceneFile file;
  const std::filesystem::path path = file.path();
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(path.parent_path());
  const Scene of_file = Scene::FromFile(path.filename().string());
  const Scene of_text = Scene::FromText(of_file.text(), "");
  std::filesystem::current_path(before);
  CHECK(std::filesystem::equivalent(of_file.folder(), path.parent_path()));
  CHECK(of_text.folder() == of_file.folder());
  CHECK(Simulation(Scene::FromText(of_file.text(), of_file.folder())).node_count() > 0);
}

TEST_CASE("A copy continues like the original, to the bit, in every shipped scene", "[api]") {
  const int steps = kUnderSanitizer ? 3 : 12;
  for (const std::string& file : SomeSceneFiles(0)) {
    INFO(file);
    const Scene scene = Scene::FromFile(file);
    Simulation simulation(scene);
    Wanderer hands(11);
    Wander(simulation, hands, steps);
    const Simulation saved = simulation;
    const Shown then = Show(simulation);

    Simulation copy = saved;
    CHECK(Show(copy) == then);
    Wanderer same = hands;
    Wander(simulation, hands, steps);
    const Shown later = Show(simulation);
    CHECK(later.hash != then.hash);
    Wander(copy, same, steps);
    CHECK(Show(copy) == later);

    // Assigns a saved copy after the simulation has taken another course.
    Wanderer other(12);
    Wander(simulation, other, steps);
    CHECK(Show(simulation).hash != later.hash);
    simulation = saved;
    CHECK(Show(simulation) == then);
    Wanderer again(11);
    for (int k = 0; k < steps; ++k) again.Next(Command{.hands = simulation.command().hands});
    Wander(simulation, again, steps);
    CHECK(Show(simulation).hash == later.hash);
  }
}

TEST_CASE("A copy within a tick that the budget cut continues the tick", "[api]") {
  const torquer::test::SceneFile file(
      std::string("linear_density_g_m = 5\n[relaxation]\nbudget_units = 3\n") +
      "[effects.friction]\ncoefficient = 0.1\n[effects.inertia]\n[effects.torsion]\n");
  const Scene scene = Scene::FromFile(file.path());
  CheckCopiesOnTheWay(scene, kUnderSanitizer ? 10 : 60);
}

TEST_CASE("A copy keeps the blood that Windkessels store", "[api]") {
  const Scene scene = Scene::FromFile(kScenes + "/neuro_angio.toml");
  Simulation simulation(scene);
  Wanderer hands(6);
  Wander(simulation, hands, 4);
  Simulation copy = simulation;
  Wanderer same = hands;
  Wander(simulation, hands, 4);
  Wander(copy, same, 4);
  CHECK(Show(copy) == Show(simulation));
}

TEST_CASE("Instruments that twist within each other are copied within a tick", "[api]") {
  const Scene scene = ShippedWith("triaxial", "[effects.gravity]\n",
                                  "[effects.friction_between]\ncoefficient = "
                                  "0.1\n[relaxation]\nbudget_units = 3\n");
  CheckCopiesOnTheWay(scene, kUnderSanitizer ? 3 : 20);
}

TEST_CASE("The paper's method is copied within its cycles", "[api]") {
  const torquer::test::SceneFile file(std::string(torquer::test::kPaperMethod) +
                                      "budget_units = 3\n");
  const Scene scene = Scene::FromFile(file.path());
  Simulation simulation(scene);
  Command command = simulation.command();
  for (int k = 0; k < 60; ++k) {
    command.time_s += 0.02;
    command.hands[0].insertion_mm += k % 12 == 0 ? 1 : 0;
    Simulation copy = simulation;
    simulation.Step(command);
    copy.Step(command);
    REQUIRE(Show(copy) == Show(simulation));
  }
}

TEST_CASE("A restarted simulation repeats a new one, in every shipped scene", "[api]") {
  const int steps = kUnderSanitizer ? 2 : 8;
  for (const std::string& file : SomeSceneFiles(1)) {
    INFO(file);
    const Scene scene = Scene::FromFile(file);
    Simulation used(scene);
    Wanderer before(1);
    Wander(used, before, steps);
    Show(used);  // renders
    used.Restart();
    Simulation fresh(scene);
    CHECK(Show(used) == Show(fresh));
    Wanderer hands(2);
    Wanderer same(2);
    Wander(used, hands, steps);
    Wander(fresh, same, steps);
    CHECK(Show(used) == Show(fresh));
  }
}

TEST_CASE("A simulation repeats an earlier, deleted one in the same scene", "[api]") {
  for (const char* name : {"coronary", "everything", "neuro_angio"}) {
    INFO(name);
    const Scene scene = Scene::FromFile(kScenes + "/" + name + ".toml");
    const auto run = [&scene](unsigned seed) {
      Simulation simulation(scene);
      Wanderer hands(seed);
      Wander(simulation, hands, kUnderSanitizer ? 2 : 6);
      return Show(simulation);
    };
    const Shown first = run(3);
    CHECK(run(4).hash != first.hash);
    CHECK(run(3) == first);
    const Simulation meanwhile(scene);
    CHECK(run(3) == first);
  }
}

TEST_CASE("A road map of one session is not seen in the next", "[api]") {
  const Scene scene = ShippedWith("coronary", "[effects.fluoroscopy]\n", "mode = \"roadmap\"\n");
  const auto run = [](Simulation& simulation, bool contrast, int steps) {
    Command command = simulation.command();
    for (int k = 1; k <= steps; ++k) {
      command.time_s = 0.1 * k;
      command.xray = true;
      command.contrast = contrast;
      simulation.Step(command);
      simulation.LastPicture();
    }
    return simulation.LastPicture().gray;
  };
  Simulation used(scene);
  Simulation fresh(scene);
  const auto dyed = run(used, true, 5);
  used.Restart();
  CHECK(used.LastPicture().width == 0);
  const auto again = run(used, false, 2);
  CHECK(again == run(fresh, false, 2));
  CHECK(again != dyed);
}

TEST_CASE("A program and a script get the same states", "[api]") {
  const torquer::test::TemporaryFolder folder;
  const std::string script = folder.Path() + "/script.csv";
  const std::string states = folder.Path() + "/states.jsonl";
  const Scene scene = Scene::FromFile(kScenes + "/triaxial.toml");
  Simulation simulation(scene);
  std::ofstream rows(script);
  rows.precision(17);
  rows << "time_s,guidewire.insertion_mm,catheter.rotation_rad\n0,0,0\n";
  std::vector<std::string> hashes;
  Command command = simulation.command();
  const double start_mm = command.hands[0].insertion_mm;
  simulation.Step(command);  // as the script's first row
  for (int k = 1; k <= 5; ++k) {
    command.time_s = 0.1 * k;
    command.hands[0].insertion_mm = start_mm + 2 * k;
    command.hands[1].rotation_rad = -0.1 * k;
    rows << command.time_s << ',' << 2 * k << ',' << -0.1 * k << '\n';
    simulation.Step(command);
    hashes.push_back(std::to_string(simulation.state_hash()));
  }
  rows.close();
  torquer::test::ChildProcess run({torquer::test::ProgramPath("torquer-simulator"), "--scene",
                                   kScenes + "/triaxial.toml", "--script", script, "--states",
                                   states});
  const int status = run.Wait();
  INFO(run.Error());
  REQUIRE(status == 0);
  std::ifstream in(states);
  std::string line;
  std::getline(in, line);  // state of the first row, without motion
  for (const std::string& hash : hashes) {
    REQUIRE(std::getline(in, line));
    CHECK(nlohmann::json::parse(line)["state_hash"] == hash);
  }
}

TEST_CASE("A scene's text makes it again", "[api]") {
  for (const std::string& file : SceneFiles()) {
    const Scene scene = Scene::FromFile(file);
    const Scene again = Scene::FromText(scene.text(), scene.folder());
    INFO(file);
    CHECK(again.content_hash() == scene.content_hash());
    CHECK(again.name() == scene.name());
    CHECK(std::filesystem::path(scene.folder()).is_absolute());
  }
}

TEST_CASE("A scene describes its vessel", "[api]") {
  const Scene scene = Scene::FromFile(kScenes + "/neuro_arch.toml");
  const std::vector<std::string> names = scene.centerlines();
  REQUIRE(names.size() > 10);
  const auto distance = [](const torquer::Point& a, const torquer::Point& b) {
    return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
  };
  const std::vector<torquer::Point> route = scene.RouteMm(names[0], 0, 2);
  REQUIRE(route.size() > 100);
  for (std::size_t k = 1; k < route.size(); ++k) CHECK(distance(route[k], route[k - 1]) < 2.001);
  // The path begins where the wire enters, ends where requested, and stays in the lumen.
  Simulation simulation(scene);
  const double* const entry = simulation.nodes_mm();
  CHECK(distance(route.front(), {entry[0], entry[1], entry[2]}) < 1);
  CHECK(distance(route.back(), scene.CenterlineMm(names[0], 1).front()) < 1e-9);
  const std::array<torquer::Point, 2> box = scene.bounds_mm();
  for (const torquer::Point& point : route) {
    CHECK(scene.ClearanceMm(point) > 0);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      CHECK(point[axis] > box[0][axis]);
      CHECK(point[axis] < box[1][axis]);
    }
  }
  CHECK(scene.ClearanceMm(box[0]) < 0);
}

TEST_CASE("Simulations of one scene run beside each other as one by one", "[api]") {
  const torquer::test::TemporaryFolder cache;
  const Scene scene = Scene::FromFile(kScenes + "/abdominal_aorta.toml");
  const auto run = [&scene](unsigned seed) {
    Simulation simulation(scene);
    Wanderer hands(seed);
    Wander(simulation, hands, kUnderSanitizer ? 2 : 10);
    return Show(simulation);
  };
  std::vector<Shown> beside(4);
  std::vector<std::thread> threads;
  for (unsigned seed = 0; seed < 4; ++seed) {
    threads.emplace_back([&, seed] { beside[seed] = run(seed); });
  }
  for (std::thread& thread : threads) thread.join();
  for (unsigned seed = 0; seed < 4; ++seed) CHECK(beside[seed] == run(seed));
}

TEST_CASE("Unusable values are refused without effect", "[api]") {
  CHECK_THROWS_WITH(Scene::FromFile("no/such.toml"), Contains("no/such.toml"));
  CHECK_THROWS_WITH(Scene::FromText("name = \"x\"\n[vessel]\nkind = \"sponge\"\n", "."),
                    Contains("scene:3") && Contains("sponge"));
  const torquer::test::SceneFile file;
  const Scene scene = Scene::FromFile(file.path());
  CHECK_THROWS_WITH(scene.CenterlineMm("aorta", 1), Contains("aorta") && Contains("main"));
  CHECK_THROWS_WITH(scene.CenterlineMm("main", 0), Contains("step_mm"));
  CHECK_THROWS_WITH(scene.RouteMm("main", 1e6, 1), Contains("main"));
  CHECK_THROWS_WITH(scene.CenterlineMm("main", 1e-9), Contains("step_mm is 1e-09"));
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    CHECK_THROWS_WITH(scene.CenterlineMm("main", bad), Contains("step_mm"));
    CHECK_THROWS_AS(scene.RouteMm("main", bad, 1), torquer::Error);
    CHECK_THROWS_WITH(scene.ClearanceMm({0, bad, 0}), Contains("point_mm"));
  }
  Simulation simulation(scene);
  CHECK_THROWS_WITH(simulation.LastPicture(), Contains("[effects.fluoroscopy]"));
  CHECK_THROWS_WITH(simulation.PlacesInPicture({}), Contains("[effects.fluoroscopy]"));
  CHECK_THROWS_WITH(simulation.forces(), Contains("[effects.internal_forces]"));
  CHECK_THROWS_WITH(scene.surface(), Contains("ty_phantom") && Contains("kind = \"surface\""));
  const Shown before = Show(simulation);
  const auto refuse = [&](const std::function<void(Command&)>& spoil, const std::string& said) {
    Command command = simulation.command();
    command.time_s = 1;
    spoil(command);
    CHECK_THROWS_WITH(simulation.Step(command), Contains(said));
    CHECK(Show(simulation) == before);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refuse([](Command& c) { c.time_s = -1; }, "give increasing times");
  refuse([&](Command& c) { c.time_s = nan; }, "time_s is nan, not a finite number");
  refuse([](Command& c) { c.time_s = std::numeric_limits<double>::infinity(); },
         "time_s is inf, not a finite number; give seconds, at least 0");
  refuse([](Command& c) { c.hands.clear(); }, "hands has 0 entries");
  refuse([](Command& c) { c.hands.emplace_back(); }, "hands has 2 entries");
  refuse([&](Command& c) { c.hands[0].insertion_mm = nan; }, "guidewire");
  refuse([](Command& c) { c.hands[0].insertion_mm = -3; },
         "the hand of guidewire is at -3 mm; give 0 or more");
  refuse([](Command& c) { c.hands[0].rotation_rad = 1e6; }, "within 1e5");
  refuse([&](Command& c) { c.lao_deg = nan; }, "C-arm");
  refuse([](Command& c) { c.cra_deg = 181; }, "181");
  refuse([](Command& c) { c.imaging.pulses_per_s = 61; }, "pulses_per_s 61");
  refuse([&](Command& c) { c.imaging.magnification = nan; }, "magnification nan");
  refuse([](Command& c) { c.imaging.top = 0.5; }, "top 0.5");
  refuse([](Command& c) { c.imaging.wedge_left.share = 0.51; }, "wedges left 0.51 at 0 deg");
  refuse([&](Command& c) { c.imaging.wedge_right.rotation_deg = nan; }, "right 0 at nan deg");
  refuse([](Command& c) { c.table.height_mm = 151; }, "height_mm 151; give -150 to 150");
  refuse([&](Command& c) { c.table.left_mm = nan; }, "left_mm nan");
  refuse([](Command& c) { c.injector.rate_mL_s = 46; },
         "rate_mL_s 46; give 0.1 to 45, or -1 for the scene's value");
  refuse([&](Command& c) { c.injector.rise_s = nan; }, "rise_s nan; give 0 to 9.9");
  refuse([](Command& c) { c.injector.order = static_cast<torquer::Injector::Order>(3); },
         "order 3; give off, arm or inject");
  refuse([](Command& c) { c.imaging.mode = static_cast<torquer::Imaging::Mode>(5); }, "mode 5");
  simulation.Step(simulation.command());
  CHECK_THROWS_WITH(simulation.Step(simulation.command()), Contains("give increasing times"));
}
