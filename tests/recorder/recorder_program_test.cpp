// torquer-recorder on a bus: it records every message, in order, however the session is stopped.
#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "host/bus/bus.h"
#include "host/bus/state_outline.h"
#include "host/recorder/session_log.h"
#include "protocol/lcm_channels.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"
#include "tests/support/temporary_folder.h"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

using namespace torquer;
using namespace torquer::test;

namespace {

struct Recorded {
  std::vector<std::int64_t> sequences;
  SessionLogSummary summary;
};

Recorded Read(const std::string& path) {
  Recorded recorded;
  SessionHandlers handlers;
  handlers.command = [&](const torquer_lcm::instrument_command_t& command) {
    recorded.sequences.push_back(command.sequence);
  };
  recorded.summary = ReadSessionLog(path, handlers);
  return recorded;
}

// A running recorder, and a publisher on its bus.
struct Session {
  explicit Session(const std::vector<std::string>& options = {}) {
    std::vector<std::string> words{ProgramPath("torquer-recorder"), path};
    words.insert(words.end(), options.begin(), options.end());
    recorder.emplace(words);
    command.instrument = protocol::kGuidewire;
    // Once the log exists, the recorder misses no message.
    for (int i = 0; i < 2000 && !std::filesystem::exists(path); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    REQUIRE(std::filesystem::exists(path));
  }
  void Publish() {
    REQUIRE(bus.Publish(protocol::kInstrumentCommandChannel, command));
    ++command.sequence;
  }

  TemporaryFolder folder;
  std::string path = folder.Path("log");
  std::optional<ChildProcess> recorder;
  bus::Bus bus;
  torquer_lcm::instrument_command_t command{};
};

}  // namespace

TEST_CASE("The recorder loses no message while it is stopped, and none at the end") {
  NeedPrivateNetwork();
  Session session;
  // 100 messages exceed the queue of LCM's own recorder.
  const auto burst = [&] {
    for (int i = 0; i < 100; ++i) session.Publish();
  };
  burst();
  session.recorder->Signal(SIGSTOP);
  burst();
  session.recorder->Signal(SIGCONT);
  burst();
  session.recorder->Signal(GENERATE(SIGTERM, SIGINT));
  CHECK(session.recorder->Wait() == 0);
  CAPTURE(session.recorder->Output(), session.recorder->Error());
  CHECK_THAT(session.recorder->Output(), Catch::StartsWith("300 messages, "));
  const Recorded recorded = Read(session.path);
  REQUIRE(recorded.sequences.size() == 300);
  for (std::size_t i = 0; i < 300; ++i) REQUIRE(recorded.sequences[i] == static_cast<int>(i));
  CHECK_FALSE(recorded.summary.damage.any());
}

TEST_CASE("The recording before a kill is a valid log") {
  NeedPrivateNetwork();
  Session session;
  for (int i = 0; std::filesystem::file_size(session.path) == 0 && i < 3000; ++i) {
    session.Publish();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  session.recorder->Signal(SIGKILL);
  session.recorder->Wait();
  const Recorded recorded = Read(session.path);
  CHECK(recorded.sequences.size() > 10);
  CHECK_FALSE(recorded.summary.damage.any());
}

TEST_CASE("The recorder thins shapes, ends with one, and writes several parts") {
  NeedPrivateNetwork();
  Session session({"--shapes", "5", "--part-mb", "0.1", "--keep", "3"});
  torquer_lcm::wire_state_t state{};
  state.segment_count = 500;
  state.stride = 1;
  state.nodes_mm.assign(501, {1, 2, 3});
  state.node_count = 501;
  const auto publish = [&] {
    REQUIRE(session.bus.Publish(protocol::kWireStateChannel, state));
    ++state.tick;
    session.Publish();
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  };
  for (int k = 0; k < 30'000 && !std::filesystem::exists(session.path + ".part005"); ++k) publish();
  for (int k = 0; k < 10; ++k) publish();
  session.recorder->Signal(SIGTERM);
  CHECK(session.recorder->Wait() == 0);
  CAPTURE(session.recorder->Output(), session.recorder->Error());
  // A busy recorder reads some messages after the last look at its parts, and may begin another.
  const std::string output = session.recorder->Output();
  int parts = 0;
  int removed = 0;
  const std::size_t reported = std::min(output.find("and its parts"), output.size());
  REQUIRE(std::sscanf(output.c_str() + reported, "and its parts, %d in all; the oldest %d ", &parts,
                      &removed) == 2);
  CHECK(parts >= 5);
  CHECK(removed == parts - 3);
  CHECK_FALSE(std::filesystem::exists(session.path));
  CHECK_FALSE(std::filesystem::exists(session.path + ".part002"));
  std::vector<bool> outlines;
  std::int64_t newest = -1;
  std::int64_t missing = 0;
  SessionHandlers handlers;
  handlers.state = [&](const torquer_lcm::wire_state_t& recorded) {
    outlines.push_back(bus::IsOutline(recorded));
    if (newest >= 0 && recorded.tick != newest) missing += recorded.tick - newest - 1;
    newest = recorded.tick;
  };
  const SessionLogSummary summary = ReadSessionLog(session.path, handlers);
  CHECK_FALSE(summary.damage.any());
  REQUIRE(outlines.size() > 100);
  CHECK_FALSE(outlines.front());
  CHECK_FALSE(outlines.back());
  CHECK(missing == 0);
  CHECK(newest == state.tick - 1);
  CHECK(std::count(outlines.begin(), outlines.end(), false) <
        static_cast<std::ptrdiff_t>(outlines.size() / 10));
}

TEST_CASE("A log that cannot be made is refused before anything is recorded") {
  NeedPrivateNetwork();
  ChildProcess recorder({ProgramPath("torquer-recorder"), "/none/log"});
  CHECK(recorder.Wait() == 2);
  CHECK_THAT(recorder.Error(), Catch::StartsWith("torquer-recorder: /none/log: cannot be made"));
  ChildProcess keeper({ProgramPath("torquer-recorder"), "/none/log", "--keep", "2"});
  CHECK(keeper.Wait() == 2);
  CHECK_THAT(keeper.Error(), Catch::Contains("--keep needs --part-mb; give both"));
}
