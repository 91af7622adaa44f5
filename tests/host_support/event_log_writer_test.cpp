#include "host/support/event_log_writer.h"

#include <sys/resource.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <lcm/lcm-cpp.hpp>
#include <string>
#include <vector>

#include "host/support/error.h"
#include "host/support/event_log.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;
using torquer::EventLogReader;
using torquer::EventLogWriter;
using torquer::LogRecord;
using torquer::test::TemporaryFolder;

namespace {

std::vector<std::uint8_t> BytesOf(int k) {
  return std::vector<std::uint8_t>(static_cast<std::size_t>(17 * k % 500),
                                   static_cast<std::uint8_t>(k));
}

// Limits the size of this process's files, as if the disk were full.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) : before_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &limit_);
    const rlimit less{bytes, limit_.rlim_max};
    REQUIRE(setrlimit(RLIMIT_FSIZE, &less) == 0);
  }
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &limit_);
    std::signal(SIGXFSZ, before_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit limit_{};
  void (*before_)(int);
};

}  // namespace

TEST_CASE("LCM reads a written log") {
  const TemporaryFolder folder;
  {
    EventLogWriter log(folder.Path("log"));
    for (int k = 0; k < 1000; ++k) {
      log.Write(1'700'000'000'000'000 + k, k % 2 == 0 ? "EVEN" : "ODD", BytesOf(k));
    }
    CHECK(log.next() == 1000);
    log.Finish();
    CHECK(std::filesystem::file_size(folder.Path("log")) == static_cast<std::size_t>(log.bytes()));
  }
  lcm::LogFile log(folder.Path("log"), "r");
  REQUIRE(log.good());
  for (int k = 0; k < 1000; ++k) {
    const lcm::LogEvent* event = log.readNextEvent();
    REQUIRE(event != nullptr);
    CHECK(event->eventnum == k);
    CHECK(event->timestamp == 1'700'000'000'000'000 + k);
    CHECK(event->channel == (k % 2 == 0 ? "EVEN" : "ODD"));
    const auto* bytes = static_cast<const std::uint8_t*>(event->data);
    CHECK(std::vector<std::uint8_t>(bytes, bytes + event->datalen) == BytesOf(k));
  }
  CHECK(log.readNextEvent() == nullptr);
}

TEST_CASE("A full disk leaves the whole records, and reports their number") {
  const TemporaryFolder folder;
  EventLogWriter log(folder.Path("log"));
  std::string said;
  {
    const FullDisk disk(300'000);
    try {
      for (int k = 0; k < 5000; ++k) log.Write(k, "CHANNEL", BytesOf(k));
      log.Finish();
    } catch (const torquer::UserError& error) {
      said = error.what();
    }
  }
  CHECK_THAT(said, Contains(folder.Path("log")) && Contains("cannot be written") &&
                       Contains("free space"));
  EventLogReader reader(folder.Path("log"));
  std::int64_t records = 0;
  for (LogRecord record; reader.Next(record);) ++records;
  CHECK(records > 500);
  CHECK_FALSE(reader.damage().any());
  CHECK_THAT(said, Contains("it ends after record " + std::to_string(records) + ","));
}

TEST_CASE("A log does not replace another file") {
  const TemporaryFolder folder;
  std::ofstream(folder.Path("there")) << "kept";
  CHECK_THROWS_WITH(EventLogWriter(folder.Path("there")),
                    Contains("there: exists already; give another name"));
  CHECK(std::filesystem::file_size(folder.Path("there")) == 4);
  CHECK_THROWS_WITH(EventLogWriter("/dev/null"), Contains("/dev/null: exists already"));
  CHECK_THROWS_WITH(EventLogWriter(folder.Path("none/log")), Contains("none/log: cannot be made"));
}
