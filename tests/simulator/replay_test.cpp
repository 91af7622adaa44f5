#include "host/simulator/replay.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <random>

#include "host/bus/message_check.h"
#include "host/bus/state_outline.h"
#include "host/simulator/simulation.h"
#include "host/support/error.h"
#include "tests/simulator/state_log.h"
#include "tests/support/file_contents.h"
#include "tests/support/sanitizer.h"
#include "tests/support/scenes.h"

using Catch::Contains;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::SceneFile;

namespace {

// Moves every instrument back and forth, each at its own rate.
torquer::InstrumentPoses Moved(torquer::InstrumentPoses poses, int tick) {
  for (int k = 0; k < poses.size(); ++k) {
    poses[k].insertion_mm += 15 / (k + 1.0) * std::sin((0.07 + 0.02 * k) * tick) + 0.013 * tick;
    poses[k].rotation_rad = 0.1 * (k + 1) * std::cos(0.2 * tick);
  }
  return poses;
}

// Runs and records a session of `ticks` with random budgets, as with a clock. `spoil` may change a
// state on its way to the log, or drop it by returning false.
void Record(const std::string& scene_file, const std::string& log, int ticks,
            const std::function<bool(torquer_lcm::wire_state_t&)>& spoil) {
  torquer::scene::Scene scene(scene_file);
  Simulation simulation(scene);
  torquer::test::StateLog states(log);
  std::mt19937 random(20161108);
  for (int tick = 0; tick <= ticks; ++tick) {
    if (tick > 0) {
      Command command;
      command.target = Moved(scene.start(), tick);
      torquer::CountedBudget budget(static_cast<int>(1 + random() % 12));
      simulation.Tick(command, budget);
    }
    torquer_lcm::wire_state_t state{};
    simulation.Describe(state);
    if (spoil(state)) states.Write(state);
  }
}

bool Keep(torquer_lcm::wire_state_t&) { return true; }

std::vector<std::uint8_t> Encoded(const torquer_lcm::wire_state_t& state) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(state.getEncodedSize()));
  state.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

// Copies into `state` the inputs that a simulation does not compute: machine times, and the
// transport data of commands. They come from `given`.
torquer_lcm::wire_state_t WithoutWhatIsGiven(torquer_lcm::wire_state_t state,
                                             const torquer_lcm::wire_state_t& given) {
  state.clock_id = given.clock_id;
  state.publish_us = given.publish_us;
  state.solve_us = given.solve_us;
  constexpr std::int32_t kOfTheWire = torquer::protocol::kWireConverged |
                                      torquer::protocol::kWireOutsideLumen |
                                      torquer::protocol::kWireSnapped;
  state.status = (state.status & kOfTheWire) | (given.status & ~kOfTheWire);
  for (std::size_t k = 0; k < state.instruments.size() && k < given.instruments.size(); ++k) {
    state.instruments[k].command_sequence = given.instruments[k].command_sequence;
    state.instruments[k].origin_us = given.instruments[k].origin_us;
  }
  return state;
}

}  // namespace

TEST_CASE("A replay repeats the work and reaches the same states to the bit", "[simulator]") {
  const std::string more =
      GENERATE(std::string(""), std::string(torquer::test::kFriction),
               std::string(torquer::test::kPaperMethod),
               std::string(torquer::test::kMicrocatheter) + torquer::test::kFriction,
               std::string(torquer::test::kMicrocatheter) + torquer::test::kGuidingCatheter);
  const SceneFile file(more);
  Record(file.path(), file.Beside("log"), 150, Keep);
  torquer::scene::Scene scene(file.path());
  const auto result = torquer::simulator::Replay(scene, file.Beside("log"));
  CHECK(result.states == 151);
  CHECK(result.differing == 0);
}

TEST_CASE("Later states restore states that were not recorded", "[simulator]") {
  const std::string more = GENERATE(std::string(""), std::string(torquer::test::kMicrocatheter));
  const SceneFile file(more);
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

TEST_CASE("A log without most shapes is repeated, over gaps too, and reports this", "[simulator]") {
  const SceneFile file(torquer::test::kMicrocatheter);
  // Thins as the recorder does: a shape every 50 ticks, the past every 16.
  const auto thin = [](torquer_lcm::wire_state_t& state) {
    if (state.tick % 50 != 0) torquer::bus::ReduceToOutline(state);
    if (state.tick % 16 != 0) torquer::bus::DropPast(state);
  };
  const auto replay = [&file](const std::function<bool(torquer_lcm::wire_state_t&)>& spoil) {
    Record(file.path(), file.Beside("log"), 150, spoil);
    torquer::scene::Scene scene(file.path());
    return torquer::simulator::Replay(scene, file.Beside("log"));
  };
  auto result = replay([&](torquer_lcm::wire_state_t& state) {
    thin(state);
    return true;
  });
  CHECK(result.states == 151);
  CHECK(result.outlines == 147);
  CHECK(result.differing == 0);
  // The state of tick 64 contains the missing ticks; the states before it wait for them.
  result = replay([&](torquer_lcm::wire_state_t& state) {
    thin(state);
    return (state.tick < 49 || state.tick > 52) && state.tick != 55;
  });
  CHECK(result.states == 146);
  CHECK(result.missing == 5);
  CHECK(result.differing == 0);
  result = replay([&](torquer_lcm::wire_state_t& state) {
    thin(state);
    if (state.tick == 40) state.state_hash ^= 1;
    if (state.tick == 41) state.nodes_mm[1][2] += 1e-3F;
    if (state.tick == 42) state.instruments[1].tip_mm[0] += 1e-12;
    return true;
  });
  CHECK(result.differing == 3);
  CHECK(result.first_difference == 40);
  const auto unbridged = [&](std::int64_t first_lost, std::int64_t next) {
    return [&thin, first_lost, next](torquer_lcm::wire_state_t& state) {
      thin(state);
      return state.tick < first_lost || state.tick >= next;
    };
  };
  CHECK_THROWS_WITH(replay(unbridged(60, 95)),
                    Contains("the state of tick 59 is followed by that of"));
  CHECK_THROWS_WITH(replay(unbridged(145, 147)), Contains("the state of tick 144 is followed by"));
}

TEST_CASE("A replay finds one flipped bit in a state", "[simulator]") {
  const SceneFile file;
  constexpr std::int64_t kSpoiled = 6;
  torquer::scene::Scene scene(file.path());
  std::vector<std::uint8_t> plain;
  Record(file.path(), file.Beside("log"), 8, [&plain](torquer_lcm::wire_state_t& state) {
    if (state.tick == kSpoiled) plain = Encoded(state);
    return true;
  });
  int spoiled = 0;
  for (std::size_t at = 8; at < plain.size(); at += torquer::test::kUnderSanitizer ? 331 : 53) {
    std::vector<std::uint8_t> bytes = plain;
    bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ (1U << (at % 8)));
    torquer_lcm::wire_state_t other{};
    if (!torquer::bus::DecodeMessage(bytes.data(), bytes.size(), other)) continue;
    INFO("byte " << at);
    bool shows = true;
    Record(file.path(), file.Beside("other"), 8, [&](torquer_lcm::wire_state_t& state) {
      if (state.tick != kSpoiled) return true;
      // Inputs that the simulation does not compute cannot be checked by a replay.
      shows = Encoded(WithoutWhatIsGiven(other, state)) != plain;
      state = other;
      return true;
    });
    if (!shows) continue;
    ++spoiled;
    // A log whose tick shows another run is refused.
    const auto good = [&] {
      try {
        return torquer::simulator::Replay(scene, file.Beside("other")).Good();
      } catch (const torquer::UserError&) {
        return false;
      }
    };
    CHECK_FALSE(good());
  }
  CHECK(spoiled > (torquer::test::kUnderSanitizer ? 3 : 20));
}

TEST_CASE("A replay of a damaged log continues after the damage, and is not clean", "[simulator]") {
  const SceneFile file;
  Record(file.path(), file.Beside("log"), 40, Keep);
  torquer::scene::Scene scene(file.path());
  std::string log;
  {
    std::ifstream in(file.Beside("log"), std::ios::binary);
    log.assign(std::istreambuf_iterator<char>(in), {});
  }
  const auto replay = [&](const std::string& bytes) {
    std::ofstream(file.Beside("spoiled"), std::ios::binary) << bytes;
    return torquer::simulator::Replay(scene, file.Beside("spoiled"));
  };
  CHECK(replay(log).Good());
  std::string flipped = log;
  flipped[flipped.find("\xed\xa1\xda\x01", log.size() / 2)] ^= 1;
  const auto result = replay(flipped);
  CHECK(result.states == 40);
  CHECK(result.missing == 1);
  CHECK(result.differing == 0);
  CHECK(result.damage.places == 1);
  CHECK_FALSE(result.Good());
  const auto cut = replay(log.substr(0, log.size() - 1));
  CHECK(cut.states == 40);
  CHECK_FALSE(cut.Good());
  std::string undecodable = log;
  undecodable[undecodable.find("TORQUER_WIRE_STATE", log.size() / 2) + 18] ^= 1;  // fingerprint
  CHECK(replay(undecodable).undecodable == 1);
  CHECK_FALSE(replay(undecodable).Good());
}

TEST_CASE("A replay of two joined logs is refused before it repeats the first", "[simulator]") {
  const SceneFile file;
  Record(file.path(), file.Beside("one"), 20, Keep);
  const std::string log = torquer::test::Contents(file.Beside("one"));
  std::ofstream(file.Beside("both"), std::ios::binary) << log << log;
  torquer::scene::Scene scene(file.path());
  int asked = 0;
  CHECK_THROWS_WITH(
      torquer::simulator::Replay(scene, file.Beside("both"),
                                 [&asked](const auto&) { return ++asked > 0; }),
      Contains("both: 2 logs are joined in it") && Contains("give each log by itself"));
  CHECK(asked == 0);
}

TEST_CASE("A state published again at rest counts once in a replay", "[simulator]") {
  const SceneFile file;
  torquer::scene::Scene scene(file.path());
  Record(file.path(), file.Beside("once"), 5, Keep);
  {
    torquer::test::StateLog again(file.Beside("log"));
    lcm::LogFile once(file.Beside("once"), "r");
    while (const lcm::LogEvent* event = once.readNextEvent()) {
      torquer_lcm::wire_state_t state;
      REQUIRE(state.decode(event->data, 0, event->datalen) == event->datalen);
      for (int k = 0; k < (state.tick % 2 == 0 ? 3 : 1); ++k) again.Write(state);
    }
  }
  const auto result = torquer::simulator::Replay(scene, file.Beside("log"));
  CHECK(result.states == 6);
  CHECK(result.missing == 0);
  CHECK(result.differing == 0);
}

TEST_CASE("A replay reports a state that differs, and refuses a log with a gap", "[simulator]") {
  const SceneFile file;
  torquer::scene::Scene scene(file.path());
  Record(file.path(), file.Beside("other"), 20, [](torquer_lcm::wire_state_t& state) {
    if (state.tick == 7) state.state_hash ^= 1;
    return true;
  });
  const auto result = torquer::simulator::Replay(scene, file.Beside("other"));
  CHECK(result.differing == 1);
  CHECK(result.first_difference == 7);

  // A changed command makes all states from there on differ.
  Record(file.path(), file.Beside("less"), 20, [](torquer_lcm::wire_state_t& state) {
    if (state.tick == 5) state.instruments[0].commanded_rotation_rad += 1e-3;
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
  // Another scene, detected by its instruments: a log without a description shows nothing else.
  const SceneFile two(torquer::test::kMicrocatheter);
  Record(two.path(), file.Beside("two"), 5, Keep);
  CHECK_THROWS_WITH(torquer::simulator::Replay(scene, file.Beside("two")),
                    Contains("2 instruments"));
  Record(file.path(), file.Beside("empty"), 0, [](torquer_lcm::wire_state_t&) { return false; });
  CHECK_THROWS_WITH(torquer::simulator::Replay(scene, file.Beside("empty")),
                    Contains("holds no wire state"));
}
