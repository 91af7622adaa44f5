// Tests of wrong use of torquer.h: calls in the wrong order, nested calls, and calls from several
// threads.
#include <torquer/torquer.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "tests/support/scenes.h"

using Catch::Contains;
using torquer::Command;
using torquer::Scene;
using torquer::Simulation;

TEST_CASE("A simulation that was moved from is refused until it is assigned to") {
  const torquer::test::SceneFile file;
  Simulation simulation(Scene::FromFile(file.path()));
  Simulation moved = std::move(simulation);
  // NOLINTBEGIN(bugprone-use-after-move)
  CHECK_THROWS_WITH(simulation.scene(), Contains("moved from"));
  CHECK_THROWS_WITH(simulation.nodes_mm(), Contains("moved from"));
  CHECK_THROWS_WITH(simulation.Restart(), Contains("moved from"));
  CHECK_THROWS_WITH(simulation.Step(moved.command()), Contains("moved from"));
  CHECK_THROWS_WITH(simulation.LastPicture(), Contains("moved from"));
  CHECK_THROWS_WITH(Simulation(simulation), Contains("moved from"));
  CHECK_THROWS_WITH(moved = simulation, Contains("moved from"));
  simulation = moved;
  // NOLINTEND(bugprone-use-after-move)
  CHECK(simulation.state_hash() == moved.state_hash());
}

TEST_CASE("A simulation cannot be moved during a step") {
  const torquer::test::SceneFile file;
  Simulation simulation(Scene::FromFile(file.path()));
  const Simulation saved = simulation;
  Command command = simulation.command();
  command.time_s = 0.05;
  int looked = 0;
  simulation.Step(command, [&](const torquer::StepReport&) {
    CHECK_THROWS_WITH(simulation.Restart(), Contains("a step of this object is running"));
    CHECK_THROWS_WITH(simulation = saved, Contains("a step of this object is running"));
    CHECK_THROWS_WITH(simulation.Exchange("guidewire", "sion"),
                      Contains("a step of this object is running"));
    CHECK_THROWS_WITH(simulation.Step(command), Contains("a step of this object is running"));
    simulation.SolverErrorMm();
    looked += Simulation(simulation).state_hash() == simulation.state_hash() ? 1 : 0;
    return true;
  });
  CHECK(looked > 0);
}

TEST_CASE("Threads in one simulation are let in one by one, or refused") {
  const torquer::test::SceneFile file(
      "[[instrument]]\nname = \"catheter\"\ndevice = \"microcatheter_2_7f\"\n"
      "max_length_mm = 100\n");
  Simulation simulation(Scene::FromFile(file.path()));
  const Simulation saved = simulation;
  std::atomic<int> refused = 0;
  std::vector<std::thread> threads;
  for (unsigned seed = 0; seed < 4; ++seed) {
    threads.emplace_back([&, seed] {
      std::mt19937 random(seed);
      for (int k = 0; k < 300; ++k) {
        try {
          const unsigned what = random() % 7;
          if (what == 0) simulation.Restart();
          if (what == 1) simulation = saved;
          if (what == 2) simulation.WhileStill([&] { simulation.instruments(); });
          if (what == 3) Simulation(simulation).state_hash();
          if (what == 4) simulation.SolverErrorMm();
          // The hand of the catheter rests at 0 mm.
          if (what == 6) {
            simulation.Exchange("catheter",
                                random() % 2 == 0 ? "microcatheter_2_7f" : "diagnostic_5f");
          }
          if (what != 5) continue;
          Command command;
          simulation.WhileStill([&] { command = simulation.command(); });
          command.time_s += 0.02;
          command.hands[0].insertion_mm += 1;
          simulation.Step(command);
        } catch (const torquer::Error&) {
          ++refused;
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  INFO(refused << " calls were refused");
  simulation = saved;
  CHECK(simulation.state_hash() == saved.state_hash());
}
