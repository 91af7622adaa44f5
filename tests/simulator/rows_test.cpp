// Row-size test: the same motion in rows of different sizes must move the wire the same way.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <vector>

#include "host/simulator/program/script_run.h"
#include "host/simulator/simulation.h"
#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"
#include "tests/support/scenes.h"

namespace {

using Eigen::Vector3d;

// Rotation that swings back and forth during the advance, linear over every 2 mm.
double RotationAt(double pushed_mm) {
  const auto at = [](double mm) { return 0.8 * std::sin(2 * std::numbers::pi * mm / 60); };
  const double from_mm = 2 * std::floor(pushed_mm / 2);
  return std::lerp(at(from_mm), at(from_mm + 2), (pushed_mm - from_mm) / 2);
}

// Shapes of the wire after every 2 mm of a push in rows of `row_mm`.
std::vector<std::vector<Vector3d>> Push(torquer::scene::Scene& scene, double push_mm,
                                        double row_mm) {
  torquer::simulator::Simulation simulation(scene);
  torquer::simulator::Command command;
  command.target = simulation.target();
  const torquer::InstrumentPose start = command.target[0];
  std::vector<std::vector<Vector3d>> shapes;
  const int rows = static_cast<int>(std::lround(push_mm / row_mm));
  for (int k = 1; k <= rows; ++k) {
    const double pushed_mm = k * row_mm;
    command.time_s = pushed_mm / 20;
    command.target[0] = {start.insertion_mm + pushed_mm,
                         start.rotation_rad + RotationAt(pushed_mm)};
    torquer::CountedBudget budget(100000);
    simulation.Tick(command, budget);
    REQUIRE(simulation.report().arrived());
    const double blocks = pushed_mm / 2;
    if (std::abs(blocks - std::round(blocks)) < 1e-9) shapes.push_back(simulation.state().nodes());
  }
  return shapes;
}

// States of a script at whole seconds: 1.5 s in, 0.5 s at rest, 1 s back.
std::vector<nlohmann::json> Script(const torquer::test::SceneFile& file, double row_s,
                                   double slower = 1) {
  const std::string script = file.Beside("rows.csv");
  const std::string states = file.Beside("rows.jsonl");
  {
    std::ofstream out(script);
    out << "time_s,guidewire.insertion_mm,guidewire.rotation_rad\n";
    out.precision(12);
    const int rows = static_cast<int>(std::lround(3 / row_s));
    for (int k = 0; k <= rows; ++k) {
      const double t = k * row_s;
      const double part = t < 1.5 ? t / 1.5 : t < 2 ? 1 : 3 - t;
      out << slower * t << "," << 45 * part << "," << 1.2 * part << "\n";
    }
  }
  torquer::program::RunScript(torquer::Scene::FromFile(file.path()), script, {.states = states});
  std::vector<nlohmann::json> seconds;
  std::ifstream in(states);
  for (std::string line; std::getline(in, line);) {
    nlohmann::json row = nlohmann::json::parse(line);
    const double t = row["time_s"].get<double>() / slower;
    if (std::abs(t - std::round(t)) < 1e-9) seconds.push_back(std::move(row));
  }
  return seconds;
}

Vector3d Tip(const nlohmann::json& state) {
  const nlohmann::json& tip = state["nodes_mm"].back();
  return {tip[0].get<double>(), tip[1].get<double>(), tip[2].get<double>()};
}

constexpr char kHeartbeat[] =
    "[effects.heartbeat]\namplitude_mm = 3\ndirection = [0.3, 0, 1]\n"
    "[[effects.heartbeat.region]]\ncenter_mm = [140, 0, 0]\nradius_mm = 50\n";

}  // namespace

TEST_CASE("The size of the rows does not change the path of a wire with friction", "[simulator]") {
  // Through the arch into a branch. The hand avoids bifurcations at which rounding would decide
  // between two paths (host/simulator/core/README.md, section 9).
  torquer::scene::Scene scene(torquer::test::SourcePath("/host/scenes/neuro_arch.toml"));
  const double push_mm = torquer::test::Rounds(160, 20);
  const auto reference = Push(scene, push_mm, 0.25);
  for (const double row_mm : {0.5, 2.0}) {
    INFO("rows of " << row_mm << " mm");
    const auto shapes = Push(scene, push_mm, row_mm);
    REQUIRE(shapes.size() == reference.size());
    std::vector<double> apart_mm;
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      REQUIRE(shapes[k].size() == reference[k].size());
      apart_mm.push_back((shapes[k].back() - reference[k].back()).norm());
    }
    CHECK(apart_mm.back() < 0.5);
    // A snap may occur one row earlier or later; otherwise the tips agree.
    std::sort(apart_mm.begin(), apart_mm.end());
    CHECK(apart_mm[apart_mm.size() / 2] < 0.1);
    CHECK(apart_mm[apart_mm.size() * 9 / 10] < 2);
  }
}

TEST_CASE("The size of the rows does not change the path of a wire whose snaps take time",
          "[simulator]") {
  const torquer::test::SceneFile file(std::string("linear_density_g_m = 0.7\n[effects.inertia]\n") +
                                      torquer::test::kFriction);
  torquer::scene::Scene scene(file.path());
  const double push_mm = torquer::test::Rounds(40, 10);
  const auto reference = Push(scene, push_mm, 0.25);
  // Rows of 0.5 and 2 mm have the same parts of 12.5 ms. Parts within a row are relaxed less. Finer
  // rows have finer time steps.
  for (const double row_mm : {0.5, 2.0, 0.05}) {
    INFO("rows of " << row_mm << " mm");
    const auto shapes = Push(scene, push_mm, row_mm);
    REQUIRE(shapes.size() == reference.size());
    double most_mm = 0;
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      most_mm = std::max(most_mm, (shapes[k].back() - reference[k].back()).norm());
    }
    INFO("apart by " << most_mm << " mm");
    CHECK(most_mm < 0.3);
  }
}

TEST_CASE("A script in a moving vessel ends in the same place in rows of any length",
          "[simulator]") {
  const torquer::test::SceneFile file(std::string(torquer::test::kFriction) + kHeartbeat);
  const auto reference = Script(file, 0.02);
  REQUIRE(reference.size() == 4);
  for (const double row_s : {0.5, 1.0 / 30}) {
    INFO("rows of " << row_s << " s");
    const auto states = Script(file, row_s);
    REQUIRE(states.size() == reference.size());
    // A row that ends within a tick adds a tick there.
    const double bound_mm = row_s < 0.05 ? 0.02 : 1e-6;
    for (std::size_t k = 0; k < states.size(); ++k) {
      INFO("at " << k << " s");
      CHECK((Tip(states[k]) - Tip(reference[k])).norm() < bound_mm);
    }
  }
}

TEST_CASE("A row of any length is one tick if no effect depends on time", "[simulator]") {
  const torquer::test::SceneFile file(torquer::test::kFriction);
  const auto fast = Script(file, 0.5);
  const auto slow = Script(file, 0.5, 50);
  REQUIRE(fast.size() == 4);
  REQUIRE(slow.size() == 4);
  for (std::size_t k = 0; k < fast.size(); ++k) {
    CHECK(slow[k]["state_hash"] == fast[k]["state_hash"]);
    CHECK(slow[k]["work"] == fast[k]["work"]);
  }
}
