// Scenes of host/scenes, run as host/demo runs them.
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/simulation.h"
#include "protocol/lcm_channels.h"
#include "tests/support/paths.h"
#include "tests/support/scenes.h"

namespace {

const std::filesystem::path kScenes = torquer::test::SourcePath("/host/scenes");

std::string Text(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

// Fails for a number that stands for "none" or "never", as -1 s.
void CheckNoStandIn(const std::vector<torquer::effects::Reading>& readings) {
  for (const torquer::effects::Reading& reading : readings) {
    INFO(reading.name << " " << reading.value);
    CHECK_FALSE(reading.value == -1);
    CHECK_FALSE(std::abs(reading.value) >= 1e9);
    if (reading.name.ends_with("_s")) CHECK_FALSE(reading.value < 0);
  }
}

}  // namespace

TEST_CASE("Every shipped scene has its name and a motion to run", "[simulator]") {
  int scenes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kScenes)) {
    if (entry.path().extension() != ".toml") continue;
    INFO(entry.path());
    ++scenes;
    const std::string name = entry.path().stem();
    CHECK(Text(entry.path()).find("name = \"" + name + "\"\n") != std::string::npos);
    CHECK(std::filesystem::exists(kScenes / (name + ".motion.csv")));
  }
  CHECK(scenes >= 7);
}

TEST_CASE("No vessel that moves drives the wire at rest through its wall", "[simulator]") {
  for (const auto& entry : std::filesystem::directory_iterator(kScenes)) {
    if (entry.path().extension() != ".toml") continue;
    INFO(entry.path());
    const std::string text = Text(entry.path());
    if (text.find("[effects.heartbeat]") == std::string::npos) continue;
    torquer::scene::Scene scene(entry.path());
    torquer::simulator::Simulation simulation(scene);
    torquer::simulator::Command command;
    command.target = simulation.target();
    double deepest_mm = 0;
    // Longer than a heartbeat, in steps like those of a slow display.
    for (int k = 1; k <= 100; ++k) {
      command.time_s = 0.01 * k;
      torquer::CountedBudget budget(1000);
      deepest_mm = std::max(deepest_mm, simulation.Tick(command, budget).max_penetration_mm);
      CHECK((simulation.status() & torquer::protocol::kWireOutsideLumen) == 0);
    }
    CHECK(deepest_mm < 0.1);
  }
}

TEST_CASE("Before any event, no reading is a number that stands for none", "[simulator]") {
  // Effects that no shipped scene has.
  const torquer::test::SceneFile small(
      "[effects.segment_error]\n[effects.point_load]\nforce_mN = 1\nforce_direction = \"left\"\n");
  std::vector<std::filesystem::path> scenes = {small.path()};
  for (const auto& entry : std::filesystem::directory_iterator(kScenes)) {
    if (entry.path().extension() == ".toml") scenes.push_back(entry.path());
  }
  std::set<std::string> effects;
  for (const std::filesystem::path& path : scenes) {
    INFO(path);
    torquer::scene::Scene scene(path);
    for (const std::string& name : scene.effect_names()) effects.insert(name);
    torquer::simulator::Simulation simulation(scene);
    CheckNoStandIn(simulation.Readings());
    // Some readings are known only after a tick that has converged.
    torquer::simulator::Command command;
    command.target = simulation.target();
    command.time_s = 0.01;
    torquer::CountedBudget budget(10'000);
    REQUIRE(simulation.Tick(command, budget).converged);
    CheckNoStandIn(simulation.Readings());
  }
  CHECK(effects.size() == torquer::effects::AllEffects().size());
}
