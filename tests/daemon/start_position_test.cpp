// Start position of a daemon: from an earlier daemon, from the simulator, or zero.
#include <atomic>
#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <thread>

#include "tests/daemon/daemon_chain.h"
#include "tests/support/scenes.h"
#include "torquer_lcm/wire_state_t.hpp"

namespace {

using torquer::test::Chain;
using torquer::test::ChildProcess;
using torquer::test::Contains;
using torquer::test::Ending;
using torquer::test::EndingOf;
using torquer::test::kMmPerCount;
using torquer::test::SocketWords;
using torquer_lcm::instrument_command_t;

}  // namespace

TEST_CASE("A restarted daemon continues from the last published position") {
  const int signal = GENERATE(SIGKILL, SIGTERM);
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  const instrument_command_t before = chain.Push(1000);
  chain.daemon->Signal(signal);
  chain.daemon->Wait();
  chain.Start();
  REQUIRE(chain.daemon->WaitForError("running: reading"));
  const instrument_command_t after = chain.Push(100);
  CHECK(after.insertion_mm == Approx(before.insertion_mm + 90 * kMmPerCount));
  CHECK(after.sequence > before.sequence);
  CHECK(
      chain.daemon->WaitForError("continuing from the position of the previous daemon: 19.05 mm"));
}

TEST_CASE("The age of a position includes the time that the machine slept") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  chain.Push(1000);
  chain.daemon->Signal(SIGTERM);
  chain.daemon->Wait();
  // The boot-time clock, which includes sleep, is two days ahead; the monotonic clock is not.
  std::vector<std::string> words{"/usr/bin/unshare", "--time",     "--fork",
                                 "--kill-child",     "--boottime", "172800"};
  for (const std::string& word : SocketWords(chain.socket)) words.push_back(word);
  ChildProcess daemon(words);
  REQUIRE(daemon.WaitForError("running: reading"));
  CHECK(Contains(daemon.Error(), "starting at zero"));
}

TEST_CASE("A daemon takes up what the simulator was commanded, or begins at zero with it") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  chain.Push(1000);
  chain.daemon->Signal(SIGTERM);
  chain.daemon->Wait();

  // With several instruments, the daemon's own counts.
  torquer_lcm::wire_state_t state{};
  state.instruments.resize(2);
  state.instrument_count = 2;
  state.instruments[0].name = "microwire";
  state.instruments[0].command_sequence = 9000;
  state.instruments[0].commanded_insertion_mm = 77;
  torquer_lcm::instrument_state_t& guidewire = state.instruments[1];
  guidewire.name = "guidewire";
  guidewire.inserted_at_start_mm = 100;
  double expected_mm = 0.0;
  SECTION("a simulator that was last commanded elsewhere is believed") {
    guidewire.command_sequence = 4711;
    guidewire.commanded_insertion_mm = 223.5;
    guidewire.commanded_rotation_rad = -1.5;
    expected_mm = 123.5;
  }
  SECTION("a simulator that was not commanded yet begins at zero") {
    guidewire.command_sequence = -1;
    guidewire.commanded_insertion_mm = 100;
  }
  std::atomic<bool> stop = false;
  std::thread simulator([&] {
    torquer::bus::Bus bus;
    while (!stop) {
      bus.Publish(torquer::protocol::kWireStateChannel, state);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  chain.Start();
  const bool here = chain.daemon->WaitForError("running: reading");
  stop = true;
  simulator.join();
  REQUIRE(here);
  const instrument_command_t after = chain.Push(100);
  CHECK(after.insertion_mm == Approx(expected_mm + 90 * kMmPerCount));
  CHECK(after.rotation_rad == guidewire.commanded_rotation_rad);
  CHECK(after.sequence > guidewire.command_sequence);
}

TEST_CASE("A restarted daemon does not move a wire that lay in at the start") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  const torquer::test::SceneFile scene;
  torquer_lcm::wire_state_t state{};
  chain.listener.bus->Subscribe<torquer_lcm::wire_state_t>(
      torquer::protocol::kWireStateChannel,
      [&](const torquer_lcm::wire_state_t& newest) { state = newest; }, 0);
  ChildProcess simulator(
      {torquer::test::ProgramPath("torquer-simulator"), "--scene", scene.path()});
  REQUIRE(chain.listener.Until([&] { return !state.instruments.empty(); }));
  // Sends commands and waits for a state that includes the newest. A later state may also come: it
  // keeps that place while the device is silent.
  const auto push = [&](int axial_counts) {
    const instrument_command_t command = chain.Push(axial_counts);
    REQUIRE(chain.listener.Until(
        [&] { return state.instruments[0].command_sequence >= command.sequence; }));
    return command;
  };
  const instrument_command_t before = push(1000);
  CHECK(state.instruments[0].commanded_insertion_mm == Approx(120 + before.insertion_mm));
  chain.daemon->Signal(SIGTERM);
  chain.daemon->Wait();
  SECTION("known to the daemon") {}
  SECTION("known only to the simulator") {
    std::filesystem::remove_all(chain.listener.folder.Path("torquer"));
  }
  chain.Start();
  REQUIRE(chain.daemon->WaitForError("running: reading"));
  const instrument_command_t after = push(100);
  CHECK(after.insertion_mm == Approx(before.insertion_mm + 90 * kMmPerCount));
  CHECK(state.instruments[0].commanded_insertion_mm == Approx(120 + after.insertion_mm));
}

TEST_CASE("A daemon begins at zero with a simulator that was started again") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  chain.Push(1000);
  chain.daemon->Signal(SIGTERM);
  chain.daemon->Wait();
  // This scene is at rest before the daemon listens.
  const torquer::test::SceneFile scene;
  int states = 0;
  chain.listener.bus->Subscribe<torquer_lcm::wire_state_t>(
      torquer::protocol::kWireStateChannel, [&](const torquer_lcm::wire_state_t&) { ++states; }, 0);
  ChildProcess simulator(
      {torquer::test::ProgramPath("torquer-simulator"), "--scene", scene.path()});
  REQUIRE(chain.listener.Until([&] { return states >= 3; }));
  chain.Start();
  REQUIRE(chain.daemon->WaitForError("running: reading"));
  CHECK(chain.Push(100).insertion_mm == Approx(90 * kMmPerCount));
}

TEST_CASE("Home makes the present place the start") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  chain.Push(1000);
  const Ending home = EndingOf({torquer::test::kDaemonProgram, "--home"});
  CHECK(home.status == 0);
  REQUIRE(chain.listener.UntilHealth("running", "home"));
  CHECK(chain.Push(100).insertion_mm == Approx(100 * kMmPerCount));

  const Ending catheter =
      EndingOf({torquer::test::kDaemonProgram, "--home", "--instrument", "catheter"});
  CHECK(catheter.status == 2);
  CHECK(
      Contains(catheter.error, "no torquer-daemon of this user drives the instrument 'catheter'"));
}
