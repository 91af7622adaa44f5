// Recorder on a failing disk: everything that it has written must read as a log.
#include <catch2/catch.hpp>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <utility>

#include "host/bus/bus.h"
#include "host/support/error.h"
#include "host/support/event_log.h"
#include "host/support/log_parts.h"
#include "protocol/lcm_channels.h"
#include "tests/faults/faulty_run.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"
#include "tests/support/temporary_folder.h"
#include "torquer_lcm/health_t.hpp"

namespace torquer::test {
namespace {

namespace fs = std::filesystem;

void Pause(int ms) { std::this_thread::sleep_for(std::chrono::milliseconds(ms)); }

// Waits for a file of a process; false if the process ends without it.
bool Appears(const std::string& path, ChildProcess& process) {
  constexpr int kMostMs = 60'000;
  for (int k = 0; k < kMostMs && !fs::exists(path) && !process.Ended(); ++k) Pause(1);
  return fs::exists(path);
}

// True if the newest part of a log has bytes. A part that has just begun has none, and an earlier
// part may already be removed.
bool HasBytes(const std::string& path) {
  const auto later = LaterLogParts(path);
  std::error_code none;
  const std::uintmax_t bytes = fs::file_size(later.empty() ? path : later.back(), none);
  return !none && bytes > 0;
}

// Number of records in a log and its parts; -1 if there is no log. A disk may cut off the last
// record, but cause no other damage.
std::int64_t RecordsIn(const std::string& path, bool may_be_cut) {
  if (!fs::exists(path) && LaterLogParts(path).empty()) return -1;
  EventLogReader log(path);
  std::int64_t records = 0;
  for (LogRecord record; log.Next(record);) ++records;
  INFO(log.damage().Describe());
  CHECK(log.damage().places == 0);
  CHECK(log.damage().missing == 0);
  CHECK((may_be_cut || !log.damage().cut));
  return records;
}

}  // namespace

TEST_CASE("A recording on a failing disk ends with whole records, and reports it") {
  NeedPrivateNetwork();
  bus::Bus bus;
  torquer_lcm::health_t message{};
  message.message.assign(2000, 'x');
  const auto [kind, error] = GENERATE(std::pair("ENOSPC", ENOSPC), std::pair("EIO", EIO),
                                      std::pair("EROFS", EROFS), std::pair("KILL", 0));
  for (int at = 1;; ++at) {
    const TemporaryFolder folder;
    const TemporaryFolder notes;
    const std::string path = folder.Path("log");
    const Fault fault{kind, at, folder.Path(), notes.Path("steps")};
    ChildProcess recorder(WithFault(
        fault, {ProgramPath("torquer-recorder"), path, "--part-mb", "0.15", "--keep", "1"}));
    if (Appears(path, recorder)) {
      // Enough messages for one part to be removed, and some for the last part.
      for (int k = 0; k < 210; ++k) {
        bus.Publish(protocol::kHealthChannel, message);
        if (k % 100 == 99) Pause(110);
      }
      // On a busy machine the recorder is late.
      for (int k = 0; k < 6000 && !HasBytes(path) && !recorder.Ended(); ++k) {
        bus.Publish(protocol::kHealthChannel, message);
        Pause(10);
      }
    }
    recorder.Signal(SIGTERM);
    const int status = recorder.Wait();
    const auto steps = Steps(fault);
    const bool met = steps.size() >= static_cast<std::size_t>(at);
    INFO(kind << " at step " << at << ": " << (met ? steps[static_cast<std::size_t>(at) - 1] : "")
              << "\nstatus " << status << ": " << recorder.Error());
    const std::int64_t records = RecordsIn(path, error == 0);
    if (!met) {
      CHECK(status == 0);
      CHECK(at > 6);
      CHECK(records > 0);
      break;
    }
    if (error == 0) {
      CHECK(status == 128 + SIGKILL);
      continue;
    }
    CHECK(status == 2);
    CHECK_THAT(recorder.Error(), Catch::Contains(path));
    CHECK_THAT(recorder.Error(), Catch::Contains(std::strerror(error)));
  }
}

TEST_CASE("A recording ends before its disk is full, and does not begin on such a disk") {
  NeedPrivateNetwork();
  const TemporaryFolder folder;
  const std::string path = folder.Path("log");
  const std::string room = folder.Path("room");
  const auto have = [&room](std::int64_t bytes) { std::ofstream(room) << bytes; };
  const auto words =
      WithSetting("TORQUER_FREE_BYTES=" + room, {ProgramPath("torquer-recorder"), path});
  have(99'999'999);
  {
    ChildProcess recorder(words);
    CHECK(recorder.Wait() == 2);
    CHECK_THAT(recorder.Error(), Catch::Contains(path + ": its disk has 99 MB free"));
    CHECK_FALSE(fs::exists(path));
  }
  have(100'000'000);
  ChildProcess recorder(words);
  REQUIRE(Appears(path, recorder));
  bus::Bus bus;
  torquer_lcm::health_t message{};
  for (int k = 0; k < 500; ++k) bus.Publish(protocol::kHealthChannel, message);
  Pause(50);
  have(99'999'999);
  CHECK(recorder.Wait() == 1);
  CHECK_THAT(recorder.Output(), Catch::StartsWith("500 messages"));
  CHECK_THAT(recorder.Error(), Catch::Contains(path + ": ends here and is complete"));
  CHECK(RecordsIn(path, false) == 500);
}

}  // namespace torquer::test
