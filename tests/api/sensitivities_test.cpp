// Derivatives of the states by values of a scene, against differences of whole runs.
#include <torquer/torquer.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/support/scenes.h"

namespace {

using Catch::Contains;
using torquer::Command;
using torquer::Point;
using torquer::Scene;
using torquer::Sensitivity;
using torquer::Simulation;

constexpr char kRigidity[] = "instrument.guidewire.rigidity_N_mm2";
constexpr char kTip[] = "instrument.guidewire.tip_angle_deg";
constexpr char kFriction[] = "effects.friction.coefficient";
constexpr char kWall[] = "vessel.wall_stiffness_N_mm2";

// Made aortic arch: up, over with a radius of 28 mm, and down. The wire lies on its outer wall.
std::string Arch(const std::string& more) {
  return "name = \"arch\"\n"
         "[vessel]\nkind = \"tubes\"\nwall_stiffness_N_mm2 = 2\n"
         "[[vessel.tube]]\nname = \"aorta\"\nbend_radius_mm = 28\nradii_mm = [9, 11, 12, 10]\n"
         "points_mm = [[0, 0, 0], [0, 0, 70], [60, 12, 70], [60, 12, 0]]\n"
         "[entry]\ncenterline = \"aorta\"\nat_mm = 3\n"
         "[[instrument]]\nname = \"guidewire\"\nmax_length_mm = 180\nradius_mm = 0.45\n"
         "tip_mm = 12\ntip_angle_deg = 40\nfrom_tip_mm = [0, 12, 40]\n"
         "rigidity_N_mm2 = [0.8, 0.8, 4]\ninserted_at_start_mm = 110\n"
         "[relaxation]\ntolerance = 1e-9\n" +
         more;
}

// Motion of the first hand from the start, by rows of insertion and rotation. A row has steps of a
// part each, so that all are relaxed to the tolerance.
using Rows = std::vector<std::array<double, 2>>;

void Drive(Simulation& simulation, const Rows& rows, double feed_mm = 0.2,
           const std::function<void()>& after = {}) {
  Command command = simulation.command();
  for (const auto& [along_mm, around_rad] : rows) {
    const double parts =
        std::ceil(std::max({1.0, std::abs(along_mm) / feed_mm, std::abs(around_rad) / 0.1}));
    for (int k = 0; k < static_cast<int>(parts); ++k) {
      command.time_s += 0.005;
      command.hands[0].insertion_mm += along_mm / parts;
      command.hands[0].rotation_rad += around_rad / parts;
      simulation.Step(command);
      if (after) after();
    }
  }
}

std::vector<Point> NodesOf(const Simulation& simulation) {
  std::vector<Point> nodes(simulation.node_count());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (std::size_t a = 0; a < 3; ++a) nodes[i][a] = simulation.nodes_mm()[3 * i + a];
  }
  return nodes;
}

// a * x + b * y, node by node.
std::vector<Point> Sum(double a, const std::vector<Point>& x, double b,
                       const std::vector<Point>& y) {
  REQUIRE(x.size() == y.size());
  std::vector<Point> sum = x;
  for (std::size_t i = 0; i < x.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) sum[i][k] = a * x[i][k] + b * y[i][k];
  }
  return sum;
}

double Largest(const std::vector<Point>& x) {
  double largest = 0;
  for (const Point& point : x)
    largest = std::max(largest, std::hypot(point[0], point[1], point[2]));
  return largest;
}

// Central difference of whole runs by a value or, for kRigidity, by the factor of a list. `step`:
// in parts of the value.
std::vector<Point> Difference(const Scene& scene, const std::string& key, double value, double step,
                              const Rows& rows, double feed_mm) {
  std::array<std::vector<Point>, 2> nodes;
  for (const int side : {0, 1}) {
    const double factor = side == 0 ? 1 + step : 1 - step;
    torquer::Value other = factor * value;
    if (key == kRigidity) other = std::vector<double>{0.8 * factor, 0.8 * factor, 4 * factor};
    Simulation run(scene.With({{key, other}}));
    Drive(run, rows, feed_mm);
    nodes[static_cast<std::size_t>(side)] = NodesOf(run);
  }
  const double per = 0.5 / (step * value);
  return Sum(per, nodes[0], -per, nodes[1]);
}

struct Case {
  std::string key;
  double step;      // of the differences, in parts of the value
  double most;      // of the error, in parts of the largest derivative
  double least_mm;  // of the change of the shape with the whole value, so that it is not noise
};

// `feed_mm`: of the steps, in the simulation and in the runs.
void Check(const Scene& scene, const std::vector<Case>& cases, const Rows& rows,
           double feed_mm = 0.2) {
  std::vector<std::string> keys;
  for (const Case& one : cases) keys.push_back(one.key);
  Simulation simulation(scene);
  simulation.TrackSensitivities(keys);
  Drive(simulation, rows, feed_mm);
  const std::vector<Sensitivity> found = simulation.sensitivities();
  REQUIRE(found.size() == cases.size());
  for (std::size_t k = 0; k < cases.size(); ++k) {
    INFO(found[k].key << " " << found[k].unknown);
    REQUIRE(found[k].key == cases[k].key);
    REQUIRE(found[k].unknown.empty());
    const double value = found[k].value;
    const std::vector<Point> expected =
        Difference(scene, cases[k].key, value, cases[k].step, rows, feed_mm);
    const double error = Largest(Sum(1, found[k].nodes_mm, -1, expected)) / Largest(expected);
    INFO("size " << value * Largest(expected) << " error " << error);
    CHECK(value * Largest(expected) > cases[k].least_mm);
    CHECK(error < cases[k].most);
  }
}

// Euler's theorem for rigidity and wall stiffness: all forces grow alike, also those of friction.
void CheckScaling(const std::vector<Sensitivity>& found) {
  REQUIRE(found.size() == 2);
  REQUIRE(found[0].unknown.empty());
  REQUIRE(found[1].unknown.empty());
  const std::vector<Point> both =
      Sum(found[0].value, found[0].nodes_mm, found[1].value, found[1].nodes_mm);
  const double size_mm = found[1].value * Largest(found[1].nodes_mm);
  CHECK(size_mm > 1e-4);
  // Rounding leaves some 1e-5 mm for a change by the whole value.
  CHECK(Largest(both) < 1e-3 * size_mm + 2e-5);
}

const Rows kToAndFro = {{12, 0}, {-5, 0.6}, {4, -1.2}, {-2, 0}};

}  // namespace

TEST_CASE("Derivatives on the walls of an arch are those of whole runs, without friction",
          "[api]") {
  Check(Scene::FromText(Arch("[effects]\n"), "."),
        {{kTip, 1e-4, 1e-4, 0.1}, {kWall, 1e-3, 1e-4, 1e-3}}, kToAndFro);
}

TEST_CASE("Derivatives on the walls of an arch are those of whole runs, with friction", "[api]") {
  // Anchors and normal forces depend on the values too, from part to part.
  Check(Scene::FromText(Arch("[effects.friction]\ncoefficient = 0.15\n"), "."),
        {{kTip, 1e-5, 1e-3, 0.1},
         {kWall, 1e-4, 1e-3, 1e-3},
         {kRigidity, 1e-4, 1e-3, 1e-3},
         {kFriction, 1e-5, 1e-3, 1e-2},
         {"effects.friction.slip_mm", 1e-3, 1e-3, 1e-3}},
        kToAndFro);
}

TEST_CASE("Derivatives exist for instruments on one curve, and for a wire that twists", "[api]") {
  const std::string friction = "[effects.friction]\ncoefficient = 0.15\n";
  const std::string catheter =
      "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\ninserted_at_start_mm = 60\n"
      "inner_radius_mm = 0.5\nradius_mm = 0.8\nrigidity_N_mm2 = 5\ntip_mm = 10\n"
      "tip_angle_deg = 30\n";
  std::string stack = Arch(friction);
  stack.insert(stack.find("[relaxation]"), catheter);
  Check(Scene::FromText(stack, "."),
        {{"instrument.catheter.rigidity_N_mm2", 1e-5, 1e-3, 0.1},
         {"instrument.catheter.tip_angle_deg", 1e-5, 1e-3, 0.1},
         {kTip, 1e-5, 1e-3, 0.1},
         {kFriction, 1e-5, 1e-3, 0.1}},
        kToAndFro);
  Check(Scene::FromText(Arch(friction + "[effects.torsion]\n"), "."),
        {{"instrument.guidewire.torsional_rigidity_ratio", 1e-3, 1e-3, 1e-4},
         {kTip, 1e-4, 1e-3, 0.1},
         {kFriction, 1e-4, 1e-3, 0.1}},
        kToAndFro);
}

TEST_CASE("A wire with inertia on a beating heart has derivatives too", "[api]") {
  std::string text = Arch(
      "[effects.friction]\ncoefficient = 0.1\n[effects.inertia]\n"
      "[effects.heartbeat]\namplitude_mm = 2\ndirection = [0.3, 1, 0]\nrate_per_min = 180\n"
      "[[effects.heartbeat.region]]\ncenter_mm = [30, 6, 70]\nradius_mm = 60\n");
  text.insert(text.find("[relaxation]"), "linear_density_g_m = 3\n");
  Check(Scene::FromText(text, "."),
        {{kTip, 1e-4, 1e-2, 0.1},
         {kFriction, 1e-3, 1e-2, 1e-3},
         {"effects.heartbeat.amplitude_mm", 1e-3, 1e-2, 0.1}},
        {{3, 0}, {-1, 0.3}});
}

TEST_CASE("Stiffer wires on a wall that is stiffer by the same factor keep their shape", "[api]") {
  for (const char* const effects : {"[effects]\n", "[effects.friction]\ncoefficient = 0.15\n"}) {
    Simulation simulation(Scene::FromText(Arch(effects), "."));
    simulation.TrackSensitivities({kRigidity, kWall});
    Drive(simulation, kToAndFro, 0.2, [&] { CheckScaling(simulation.sensitivities()); });
  }
}

TEST_CASE("Derivatives with friction need parts that come near rest, at the default tolerance",
          "[api]") {
  std::string text = Arch("[effects.friction]\ncoefficient = 0.15\n");
  const std::string tolerance = "tolerance = 1e-9\n";
  text.erase(text.find(tolerance), tolerance.size());
  const Scene scene = Scene::FromText(text, ".");
  Simulation simulation(scene);
  simulation.TrackSensitivities({kTip, kFriction});
  Drive(simulation, kToAndFro);
  for (const Sensitivity& found : simulation.sensitivities()) {
    INFO(found.key << " " << found.unknown);
    REQUIRE(found.unknown.empty());
    // The differences need runs that are relaxed further.
    const std::vector<Point> expected =
        Difference(Scene::FromText(Arch("[effects.friction]\ncoefficient = 0.15\n"), "."),
                   found.key, found.value, 1e-5, kToAndFro, 0.2);
    CHECK(Largest(Sum(1, found.nodes_mm, -1, expected)) < 0.03 * Largest(expected));
  }
  // A step of 5 mm has 20 parts. Some end 0.1 mm from equilibrium, so the derivatives of the
  // anchors are not known.
  simulation.Restart();
  Drive(simulation, kToAndFro, 5);
  CHECK_THAT(simulation.sensitivities().front().unknown, Contains("remember"));
  CHECK(simulation.sensitivities().front().nodes_mm.empty());
  Drive(simulation, {{1, 0}});
  CHECK_THAT(simulation.sensitivities().front().unknown, Contains("restart"));
  simulation.Restart();
  Drive(simulation, {{1, 0}});
  CHECK(simulation.sensitivities().front().unknown.empty());
  // Without friction, only the last part counts.
  Simulation free(scene.With({{"effects.friction", false}}));
  free.TrackSensitivities({kTip});
  Drive(free, {{5, 0}}, 5);
  CHECK(free.sensitivities().front().unknown.empty());
}

TEST_CASE("Tips have the derivatives of their places on the wire", "[api]") {
  const Scene scene =
      Scene::FromText(torquer::test::SceneText(std::string(torquer::test::kMicrocatheter) +
                                               "[relaxation]\ntolerance = 1e-9\n"),
                      ".");
  Simulation simulation(scene);
  simulation.TrackSensitivities({kTip});
  const Sensitivity start = simulation.sensitivities().front();
  CHECK(start.unknown.empty());
  CHECK(start.tips_mm.at(0) == start.nodes_mm.back());
  std::array<std::vector<Point>, 2> tips;
  for (const int side : {0, 1}) {
    const Simulation other(scene.With({{kTip, side == 0 ? 30.01 : 29.99}}));
    for (const auto& one : other.instruments()) {
      tips[static_cast<std::size_t>(side)].push_back(one.tip_mm);
    }
  }
  const std::vector<Point> expected = Sum(50, tips[0], -50, tips[1]);
  CHECK(Largest(Sum(1, start.tips_mm, -1, expected)) < 1e-4 * Largest(expected));
}

TEST_CASE("Tracking changes no state, and copies track on their own", "[api]") {
  const Scene scene = Scene::FromText(Arch("[effects.friction]\ncoefficient = 0.15\n"), ".");
  Simulation plain(scene);
  Simulation tracked(scene);
  tracked.TrackSensitivities({kFriction, kTip});
  std::vector<std::uint64_t> hashes;
  const Rows push = {{3, 0.2}};
  Drive(plain, push, 0.2, [&] { hashes.push_back(plain.state_hash()); });
  std::size_t step = 0;
  Drive(tracked, push, 0.2, [&] { CHECK(tracked.state_hash() == hashes.at(step++)); });
  CHECK(plain.sensitivities().empty());

  Simulation copy(tracked);
  Simulation assigned(scene);
  assigned = tracked;
  for (Simulation* const one : {&tracked, &copy, &assigned}) Drive(*one, {{-1, 0}});
  for (const std::size_t key : {0U, 1U}) {
    const Sensitivity expected = tracked.sensitivities().at(key);
    REQUIRE(expected.unknown.empty());
    CHECK(copy.sensitivities().at(key).nodes_mm == expected.nodes_mm);
    CHECK(assigned.sensitivities().at(key).nodes_mm == expected.nodes_mm);
  }
  assigned = plain;
  CHECK(assigned.sensitivities().empty());
  // Again from the start, to the same derivatives.
  Simulation once(scene);
  once.TrackSensitivities({kTip});
  Drive(once, push);
  tracked.Restart();
  tracked.TrackSensitivities({kTip});
  Drive(tracked, push);
  CHECK(tracked.sensitivities().at(0).nodes_mm == once.sensitivities().at(0).nodes_mm);
  tracked.Restart();
  tracked.TrackSensitivities({});
  CHECK(tracked.sensitivities().empty());
}

TEST_CASE("A derivative that does not exist is not known, with the reason", "[api]") {
  // Two units relax no state.
  for (const bool remembers : {false, true}) {
    const Scene scene = Scene::FromText(
        Arch(std::string("budget_units = 40\n") +
             (remembers ? "[effects.friction]\ncoefficient = 0.15\n" : "[effects]\n")),
        ".");
    Simulation simulation(scene);
    simulation.TrackSensitivities({kTip});
    Command command = simulation.command();
    command.time_s = 1;
    command.hands[0].insertion_mm += 20;
    REQUIRE_FALSE(simulation.Step(command).converged);
    const Sensitivity found = simulation.sensitivities().front();
    CHECK(found.unknown == "the last tick did not converge");
    CHECK(found.unknown_since_s == 1);
    CHECK(found.first_unknown == found.unknown);
    CHECK(found.nodes_mm.empty());
    CHECK(found.tips_mm.empty());
    // The motion goes on, and so does the memory.
    for (command.time_s = 2; !simulation.Step(command).converged; ++command.time_s) {
      REQUIRE(command.time_s < 50);
    }
    const Sensitivity later = simulation.sensitivities().front();
    CHECK(later.unknown.empty() == !remembers);
    // The tick at 1 s lost what friction remembers.
    CHECK(later.first_unknown == (remembers ? found.unknown : ""));
    CHECK((remembers ? later.unknown_since_s == 1 : std::isnan(later.unknown_since_s)));
    const Simulation copy = simulation;
    CHECK(copy.sensitivities().front().first_unknown == later.first_unknown);
    simulation.Restart();
    CHECK(simulation.sensitivities().front().first_unknown.empty());
  }
}

TEST_CASE("Keys and scenes without derivatives are refused with the remedy", "[api]") {
  const Scene scene = Scene::FromText(Arch("[effects.friction]\ncoefficient = 0\n"), ".");
  Simulation simulation(scene);
  const auto refuse = [](Simulation& of, const std::string& key, const std::string& message) {
    CHECK_THROWS_WITH(of.TrackSensitivities({key}), Contains(message));
    CHECK(of.sensitivities().empty());
  };
  refuse(simulation, "relaxation.segment_mm", "is no key of an instrument or of an effect");
  refuse(simulation, "vessel.tube.aorta.radii_mm", "is no key of an instrument or of an effect");
  refuse(simulation, "instrument.guidewire.rigidity", "has no number with the key");
  refuse(simulation, "instrument.catheter.radius_mm", "has no number with the key");
  refuse(simulation, "instrument.guidewire.name", "name");
  refuse(simulation, "instrument.guidewire.max_length_mm", "changes the length or the start");
  refuse(simulation, "instrument.guidewire.inserted_at_start_mm",
         "changes the length or the start");
  refuse(simulation, kFriction, "cannot be a little more and a little less");
  CHECK_THROWS_WITH(simulation.TrackSensitivities({kTip, kTip}), Contains("given twice"));
  Drive(simulation, {{0.2, 0}});
  refuse(simulation, kTip, "call Restart first");

  const auto refuse_scene = [&](const std::string& more, const std::string& message) {
    Simulation other(Scene::FromText(torquer::test::SceneText(more), "."));
    refuse(other, kTip, message);
  };
  refuse_scene(torquer::test::kPaperMethod, "relaxation.method = \"newton\"");
  refuse_scene("[effects.self_contact]\n", "remove [effects.clearance], [effects.self_contact]");
  refuse_scene(std::string(torquer::test::kMicrocatheter) + "[effects.clearance]\n",
               "remove [effects.clearance]");
  refuse_scene(std::string(torquer::test::kMicrocatheter) +
                   "[effects.torsion]\n[effects.friction_between]\ncoefficient = 0.1\n",
               "remove [effects.friction_between]");
}
