// Scenes of host/scenes, run as host/demo runs them.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "host/simulator/simulation.h"
#include "protocol/lcm_channels.h"
#include "tests/support/paths.h"

namespace {

const std::filesystem::path kScenes = torquer::test::SourcePath("/host/scenes");

std::string Text(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
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
