#include "host/support/log_parts.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "host/support/event_log.h"
#include "host/support/event_log_writer.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;
using torquer::EventLogReader;
using torquer::EventLogWriter;
using torquer::LogInput;
using torquer::LogRecord;
using torquer::test::TemporaryFolder;

namespace {

struct ReadParts {
  std::vector<std::int64_t> numbers;
  std::string damage;
};

ReadParts ReadAllParts(const std::string& path) {
  EventLogReader log(path);
  ReadParts read;
  for (LogRecord record; log.Next(record);) {
    CHECK(record.data.size() == static_cast<std::size_t>(record.number % 700));
    read.numbers.push_back(record.number);
  }
  read.damage = log.damage().Describe();
  return read;
}

// Writes parts 1, 2, 3 and 10 with 100 records each.
void WriteParts(const std::string& path) {
  std::int64_t number = 0;
  for (const int part : {1, 2, 3, 10}) {
    EventLogWriter log(torquer::LogPartPath(path, part), number);
    for (int k = 0; k < 100; ++k, ++number) {
      log.Write(number, "CHANNEL",
                std::vector<std::uint8_t>(static_cast<std::size_t>(number % 700)));
    }
    log.Finish();
    CHECK(log.next() == number);
  }
}

}  // namespace

TEST_CASE("A log is read with its parts, in order, and each of them with those that follow") {
  const TemporaryFolder folder;
  const std::string log = folder.Path("log");
  WriteParts(log);
  // Names that are not parts of the log.
  for (const char* name :
       {"log.part1", "log.part4", "log.part01x", "log.part0003", "logs.part005"}) {
    std::ofstream(folder.Path(name)) << "nothing";
  }
  CHECK(torquer::LaterLogParts(log) ==
        std::vector<std::string>{log + ".part002", log + ".part003", log + ".part010"});
  const ReadParts all = ReadAllParts(log);
  CHECK(all.damage.empty());
  REQUIRE(all.numbers.size() == 400);
  CHECK(all.numbers.front() == 0);
  CHECK(all.numbers.back() == 399);
  CHECK(ReadAllParts(log + ".part003").numbers.front() == 200);
  CHECK(ReadAllParts(log + ".part003").numbers.size() == 200);
  CHECK(ReadAllParts(log + ".part010").numbers.size() == 100);
  std::filesystem::current_path(folder.Path());
  CHECK(ReadAllParts("log").numbers.size() == 400);
  std::filesystem::current_path("/");
}

TEST_CASE("A part that is missing within a log is damage, one that is missing before it is not") {
  const TemporaryFolder folder;
  const std::string log = folder.Path("log");
  WriteParts(log);
  std::filesystem::remove(log + ".part002");
  CHECK(ReadAllParts(log).numbers.size() == 300);
  CHECK_THAT(ReadAllParts(log).damage, Contains("100 records missing"));
  std::filesystem::remove(log);
  CHECK(ReadAllParts(log).numbers.front() == 200);
  CHECK(ReadAllParts(log).damage.empty());
  for (const std::string& part : torquer::LaterLogParts(log)) std::filesystem::remove(part);
  CHECK_THROWS_WITH(EventLogReader(log), Contains("log: cannot be read: No such file"));
  CHECK_THROWS_WITH(EventLogReader(log + ".part002"), Contains("part002: cannot be read"));
}

TEST_CASE("Bytes are read over the ends of parts") {
  const TemporaryFolder folder;
  const std::string log = folder.Path("log");
  std::ofstream(log) << "abc";
  std::ofstream(log + ".part002").flush();
  std::ofstream(log + ".part003") << "defgh";
  const LogInput input(log, "");
  CHECK(input.bytes() == 8);
  for (std::size_t from = 0; from <= 9; ++from) {
    for (std::size_t size = 0; size <= 10; ++size) {
      std::string got(size, '-');
      got.resize(input.ReadAt(static_cast<std::int64_t>(from), got.data(), size));
      CHECK(got == (from < 8 ? std::string("abcdefgh").substr(from, size) : ""));
    }
  }
}
