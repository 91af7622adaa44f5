#include "host/support/event_log.h"

#include <sys/stat.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "host/support/error.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;
using torquer::ElapsedUs;
using torquer::EventLogReader;
using torquer::LogDamage;
using torquer::LogRecord;
using torquer::test::TemporaryFolder;

namespace {

constexpr int kRecords = 6;
constexpr std::size_t kHeaderBytes = 28;

std::string BigEndian(std::uint64_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i));
  return text;
}

std::string Record(std::uint64_t number, const std::string& channel, const std::string& data) {
  return "\xed\xa1\xda\x01" + BigEndian(number, 8) + BigEndian(1000 + number, 8) +
         BigEndian(channel.size(), 4) + BigEndian(data.size(), 4) + channel + data;
}

std::string Channel(int k) { return "CHANNEL_" + std::to_string(k); }
std::string Data(int k) {
  return std::string(static_cast<std::size_t>(3 + 7 * k), static_cast<char>('a' + k));
}
std::string Plain(int k) { return Record(static_cast<std::uint64_t>(k), Channel(k), Data(k)); }

std::string Log(int from = 0, int to = kRecords) {
  std::string log;
  for (int k = from; k < to; ++k) log += Plain(k);
  return log;
}

struct Outcome {
  std::vector<std::string> read;  // channel and data
  LogDamage damage;
  std::int64_t logs = 0;
};

Outcome Read(const std::string& log) {
  const TemporaryFolder folder;
  std::ofstream(folder.Path("log"), std::ios::binary) << log;
  EventLogReader reader(folder.Path("log"));
  Outcome outcome;
  for (LogRecord record; reader.Next(record);) {
    outcome.read.push_back(std::string(record.channel) + " " +
                           std::string(record.data.begin(), record.data.end()));
  }
  outcome.damage = reader.damage();
  outcome.logs = reader.logs();
  LogRecord again;
  CHECK_FALSE(reader.Next(again));
  return outcome;
}

std::string Expected(int k) { return Channel(k) + " " + Data(k); }

// Records in [from, to), except for `but`.
std::vector<std::string> All(int from = 0, int to = kRecords, int but = -1) {
  std::vector<std::string> all;
  for (int k = from; k < to; ++k) {
    if (k != but) all.push_back(Expected(k));
  }
  return all;
}

}  // namespace

TEST_CASE("The time between two records is within its limits for any records") {
  using Limits = std::numeric_limits<std::int64_t>;
  constexpr std::int64_t kYearUs = 31'536'000'000'000;
  CHECK(ElapsedUs(1'700'000'000'000'000, 1'700'000'000'000'250) == 250);
  CHECK(ElapsedUs(5, 4) == 0);
  CHECK(ElapsedUs(-5, 5) == 10);
  CHECK(ElapsedUs(Limits::min(), Limits::max()) == kYearUs);
  CHECK(ElapsedUs(Limits::max(), Limits::min()) == 0);
  CHECK(ElapsedUs(0, kYearUs + 1) == kYearUs);
}

TEST_CASE("A whole log is read completely", "[support]") {
  const Outcome outcome = Read(Log());
  CHECK(outcome.read == All());
  CHECK_FALSE(outcome.damage.any());
  CHECK(outcome.damage.Describe().empty());
  CHECK(Read("").read.empty());
  // A part that a logger has split off continues the count.
  CHECK_FALSE(Read(Log(3)).damage.any());
  // Records larger than the read buffer.
  std::string large;
  for (std::uint64_t k = 0; k < 5; ++k) large += Record(k, "C", std::string(70'000 + k, 'x'));
  CHECK(Read(large).read.size() == 5);
  CHECK_FALSE(Read(large).damage.any());
}

TEST_CASE("One flipped bit anywhere in a header is found, and costs one record", "[support]") {
  const std::string whole = Log();
  for (int k = 0; k < kRecords; ++k) {
    const std::size_t begin = Log(0, k).size();
    for (std::size_t at = 0; at < Plain(k).size(); ++at) {
      for (int bit = 0; bit < 8; ++bit) {
        std::string log = whole;
        log[begin + at] = static_cast<char>(log[begin + at] ^ (1 << bit));
        INFO("record " << k << ", byte " << at << ", bit " << bit);
        const Outcome outcome = Read(log);
        const bool is_time = at >= 12 && at < 20;  // not checked by the format
        const bool is_header = at < kHeaderBytes && !is_time;
        // Damage that the format can detect: not a changed letter of a channel, nor a changed data
        // byte.
        if (is_header) REQUIRE(outcome.damage.any());
        // All other records survive, unless the first defines the numbering.
        std::vector<std::string> others;
        for (const std::string& one : outcome.read) {
          for (int other = 0; other < kRecords; ++other) {
            if (other != k && one == Expected(other)) others.push_back(one);
          }
        }
        REQUIRE(others.size() >= kRecords - (k == 0 && is_header ? 2 : 1));
        REQUIRE(outcome.read.size() <= kRecords);
      }
    }
  }
}

TEST_CASE("A log cut at any place gives its whole records, and reports the cut", "[support]") {
  const std::string whole = Log();
  std::size_t records = 0;
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    while (Log(0, static_cast<int>(records) + 1).size() <= size && records < kRecords) ++records;
    INFO(size);
    const Outcome outcome = Read(whole.substr(0, size));
    REQUIRE(outcome.read == All(0, static_cast<int>(records)));
    REQUIRE(outcome.damage.cut == (size != Log(0, static_cast<int>(records)).size()));
    REQUIRE(outcome.damage.places == 0);
  }
}

TEST_CASE("A hostile length costs its record, and no memory", "[support]") {
  for (const std::size_t field : {20, 24}) {
    for (const std::uint64_t length :
         {0xffffffffULL, 0x80000000ULL, 0x7fffffffULL, 1ULL << 26, 1ULL << 20, 100ULL, 0ULL}) {
      for (const int k : {0, 2, kRecords - 1}) {
        std::string log = Log();
        log.replace(Log(0, k).size() + field, 4, BigEndian(length, 4));
        INFO("field " << field << ", length " << length << ", record " << k);
        const Outcome outcome = Read(log);
        CHECK(outcome.damage.any());
        std::size_t found = 0;
        for (const std::string& one : All(0, kRecords, k)) {
          found +=
              static_cast<std::size_t>(std::count(outcome.read.begin(), outcome.read.end(), one));
        }
        CHECK(found == kRecords - 1);
      }
    }
  }
}

TEST_CASE("A length within the file that no message has is not believed", "[support]") {
  if (torquer::test::kUnderSanitizer) return;  // it looks at every byte
  const TemporaryFolder folder;
  constexpr std::uint64_t kTooLong = (64U << 20) + 1;
  std::ofstream(folder.Path("log"), std::ios::binary)
      << Log(0, 2) << Record(2, "C", "").substr(0, 24) << BigEndian(kTooLong, 4) << "C";
  std::filesystem::resize_file(folder.Path("log"), kTooLong + 1000);  // sparse: uses no disk space
  EventLogReader reader(folder.Path("log"));
  int records = 0;
  for (LogRecord record; reader.Next(record);) ++records;
  CHECK(records == 2);
  CHECK(reader.damage().places == 1);
}

TEST_CASE("Garbage between records is skipped and counted", "[support]") {
  std::mt19937 random(20261122);
  for (int round = 0; round < torquer::test::Rounds(300, 10); ++round) {
    INFO(round);
    std::string garbage;
    for (unsigned i = 0; i < random() % 300; ++i) garbage += static_cast<char>(random());
    // With words that look like the start of a record.
    for (unsigned i = 0; i < random() % 4; ++i) {
      garbage += Plain(3).substr(0, 4 + random() % kHeaderBytes);
    }
    const int at = static_cast<int>(random() % (kRecords + 1));
    const Outcome outcome = Read(Log(0, at) + garbage + Log(at));
    REQUIRE(outcome.read == All());
    REQUIRE(outcome.damage.missing == 0);
    const bool at_end = at == kRecords && outcome.damage.cut;
    REQUIRE(outcome.damage.places == (garbage.empty() || at_end ? 0 : 1));
    if (!at_end) REQUIRE(outcome.damage.bytes == static_cast<std::int64_t>(garbage.size()));
  }
}

TEST_CASE("Numbers show missing records and records out of order", "[support]") {
  const Outcome gap = Read(Log(0, 2) + Log(4));
  CHECK(gap.damage.missing == 2);
  CHECK(gap.damage.places == 0);
  CHECK(gap.damage.Describe() == "2 records missing");
  CHECK(gap.read.size() == kRecords - 2);

  // A record out of order is damage; a log that begins after another one is not.
  const Outcome back = Read(Log(0, 4) + Log(2));
  CHECK(back.damage.places == 1);
  CHECK(back.logs == 1);
  const Outcome joined = Read(Log() + Log() + Log(0, 1));
  CHECK_FALSE(joined.damage.any());
  CHECK(joined.logs == 3);
  CHECK(joined.read.size() == 2 * kRecords + 1);

  // A single wrong number is neither a gap nor trusted.
  const Outcome wrong = Read(Log(0, 2) + Record(99, Channel(2), Data(2)) + Log(3));
  CHECK(wrong.damage.places == 1);
  CHECK(wrong.damage.missing == 1);
  CHECK(wrong.read == All(0, kRecords, 2));
  CHECK_THAT(wrong.damage.Describe(),
             Contains("1 damaged place (") && Contains("1 record missing"));
}

TEST_CASE("A file full of false records is read to its end", "[support]") {
  // Each record claims a megabyte, after which no record follows.
  std::string log;
  const std::string header = Record(1, "C", "").substr(0, 24) + BigEndian(1 << 20, 4) + "C";
  for (int i = 0; i < torquer::test::Rounds(60'000, 10); ++i) log += header + ".";
  log.append(1 << 20, '.');
  const Outcome outcome = Read(log);
  CHECK(outcome.damage.any());
}

TEST_CASE("A path that is not a file is refused", "[support]") {
  const TemporaryFolder folder;
  REQUIRE(mkfifo(folder.Path("pipe").c_str(), 0600) == 0);
  CHECK_THROWS_WITH(EventLogReader(folder.Path("pipe")), Contains("it is a pipe"));
  CHECK_THROWS_WITH(EventLogReader(folder.Path()), Contains("it is a folder"));
  CHECK_THROWS_WITH(EventLogReader(folder.Path("none")), Contains("No such file"));
}
