#include "host/simulator/replay.h"

#include <catch2/catch.hpp>
#include <lcm/lcm-cpp.hpp>
#include <random>

#include "host/simulator/session.h"
#include "protocol/lcm_channels.h"
#include "tests/simulator/scenes.h"

using Catch::Matchers::Contains;
using torquer::simulator::Command;
using torquer::simulator::Session;
using torquer::test::SceneFile;

namespace {

// Runs a session of `ticks` with budgets that end anywhere, as a clock would, and records it;
// `spoil` may change or (returning false) drop a state on its way to the log.
void Record(const std::string& scene_file, const std::string& log, int ticks,
            const std::function<bool(torquer_lcm::wire_state_t&)>& spoil) {
  torquer::scene::Scene scene(scene_file);
  Session session(scene);
  lcm::LogFile file(log, "w");
  REQUIRE(file.good());
  std::mt19937 random(20161108);
  for (int tick = 0; tick <= ticks; ++tick) {
    if (tick > 0) {
      Command command;
      command.sequence = tick;
      command.target = {120 + 15 * std::sin(0.07 * tick) + 0.013 * tick, 0.1 * std::cos(0.2 * tick),
                        60 + 0.5 * tick, 0.02 * tick};
      torquer::CountedBudget budget(static_cast<int>(1 + random() % 12));
      session.Tick(command, budget);
    }
    torquer_lcm::wire_state_t state;
    session.Describe(state);
    if (!spoil(state)) continue;
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(state.getEncodedSize()));
    state.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    lcm::LogEvent event;
    event.eventnum = tick;
    event.timestamp = tick;
    event.channel = torquer::protocol::kWireStateChannel;
    event.datalen = static_cast<int>(bytes.size());
    event.data = bytes.data();
    file.writeEvent(&event);
  }
}

bool Keep(torquer_lcm::wire_state_t&) { return true; }

}  // namespace

TEST_CASE("A replay repeats the work and reaches the same states to the bit", "[simulator]") {
  const std::string more =
      GENERATE(std::string(""), std::string(torquer::test::kFriction),
               std::string(torquer::test::kPaperMethod),
               std::string(torquer::test::kCatheter) + torquer::test::kFriction);
  const SceneFile file(more);
  Record(file.path(), file.Beside("log"), 150, Keep);
  torquer::scene::Scene scene(file.path());
  const auto result = torquer::simulator::Replay(scene, file.Beside("log"));
  CHECK(result.states == 151);
  CHECK(result.differing == 0);
}

TEST_CASE("States that were not recorded are made up for by those after them", "[simulator]") {
  const SceneFile file;
  Record(file.path(), file.Beside("log"), 80, [](torquer_lcm::wire_state_t& state) {
    const bool late = state.tick == 0;
    const bool burst = state.tick >= 40 && state.tick < 40 + torquer::simulator::kMostPastInMessage;
    return !late && !burst && state.tick != 9;
  });
  torquer::scene::Scene scene(file.path());
  const auto result = torquer::simulator::Replay(scene, file.Beside("log"));
  CHECK(result.missing == torquer::simulator::kMostPastInMessage + 2);
  CHECK(result.states + result.missing == 81);
  CHECK(result.differing == 0);
}

TEST_CASE("A replay tells a state that differs, and refuses a log with a gap", "[simulator]") {
  const SceneFile file;
  torquer::scene::Scene scene(file.path());
  Record(file.path(), file.Beside("other"), 20, [](torquer_lcm::wire_state_t& state) {
    if (state.tick == 7) state.state_hash ^= 1;
    return true;
  });
  const auto result = torquer::simulator::Replay(scene, file.Beside("other"));
  CHECK(result.differing == 1);
  CHECK(result.first_difference == 7);

  // Work that was not done leads elsewhere from there on.
  Record(file.path(), file.Beside("less"), 20, [](torquer_lcm::wire_state_t& state) {
    if (state.tick == 5) state.commanded_rotation_rad += 1e-3;
    return true;
  });
  CHECK(torquer::simulator::Replay(scene, file.Beside("less")).first_difference == 5);

  Record(file.path(), file.Beside("gap"), 60, [](torquer_lcm::wire_state_t& state) {
    return state.tick < 9 || state.tick > 9 + torquer::simulator::kMostPastInMessage;
  });
  CHECK_THROWS_WITH(torquer::simulator::Replay(scene, file.Beside("gap")), Contains("tick 8"));
  Record(file.path(), file.Beside("late"), 60, [](torquer_lcm::wire_state_t& state) {
    return state.tick > torquer::simulator::kMostPastInMessage + 1;
  });
  CHECK_THROWS_WITH(torquer::simulator::Replay(scene, file.Beside("late")), Contains("tick 34"));
  Record(file.path(), file.Beside("two runs"), 20, [](torquer_lcm::wire_state_t& state) {
    if (state.tick == 15) state.tick = 3;
    return true;
  });
  CHECK_THROWS_WITH(torquer::simulator::Replay(scene, file.Beside("two runs")), Contains("tick 3"));
  Record(file.path(), file.Beside("empty"), 0, [](torquer_lcm::wire_state_t&) { return false; });
  CHECK_THROWS_WITH(torquer::simulator::Replay(scene, file.Beside("empty")),
                    Contains("holds no wire state"));
}
