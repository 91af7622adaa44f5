#include "host/viewer/hash_check.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <string>
#include <thread>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"
#include "host/support/event_log_writer.h"
#include "protocol/lcm_channels.h"
#include "tests/support/scenes.h"
#include "tests/viewer/recorded_message.h"

using Catch::Contains;
using torquer::EventLogWriter;
using torquer::test::Write;
using torquer::viewer::HashCheck;

namespace {

// A session of 21 states; the state of tick `spoiled` has a wrong energy.
void RecordSession(torquer::scene::Scene& scene, const std::string& path, int spoiled) {
  EventLogWriter log(path);
  torquer::simulator::Simulation simulation(scene);
  for (int tick = 0; tick <= 20; ++tick) {
    if (tick > 0) {
      torquer::simulator::Command command;
      command.target = scene.start();
      command.target[0].insertion_mm += 0.3 * tick;
      torquer::CountedBudget budget(30);
      simulation.Tick(command, budget);
    }
    torquer_lcm::wire_state_t state{};
    simulation.Describe(state);
    if (tick == spoiled) state.energy_mJ += 1e-9;
    Write(log, 1000 * tick, torquer::protocol::kWireStateChannel, state);
  }
  log.Finish();
}

HashCheck::Finding Checked(torquer::scene::Scene& scene, const std::string& log) {
  const HashCheck check(scene, log);
  for (int k = 0; k < 10000; ++k) {
    const HashCheck::Finding found = check.Get();
    if (found.done || !found.error.empty()) return found;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  FAIL("the comparison does not end");
  return {};
}

}  // namespace

TEST_CASE("A replay is compared with its recording, state by state") {
  const torquer::test::SceneFile file("");
  torquer::scene::Scene scene(file.path());
  RecordSession(scene, file.Beside("good"), -1);
  const HashCheck::Finding good = Checked(scene, file.Beside("good"));
  CHECK(good.error.empty());
  CHECK(good.result.states == 21);
  CHECK(good.result.differing == 0);

  RecordSession(scene, file.Beside("bad"), 7);
  const HashCheck::Finding bad = Checked(scene, file.Beside("bad"));
  CHECK(bad.result.differing == 1);
  CHECK(bad.result.first_difference == 7);

  CHECK_THAT(Checked(scene, file.Beside("none")).error, Contains("cannot be read"));
}
