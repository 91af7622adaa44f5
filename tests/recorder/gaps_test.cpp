// Logs with removed or changed records, and the faults that the report must name.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "host/recorder/report_output.h"
#include "host/recorder/session_report.h"
#include "host/support/event_log.h"
#include "host/support/event_log_writer.h"
#include "protocol/lcm_channels.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/file_contents.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

namespace {

struct Record {
  std::int64_t time_us = 0;
  std::string channel;
  std::vector<std::uint8_t> data;
};
using Records = std::vector<Record>;

Records ReadRecords(const std::string& path) {
  Records records;
  EventLogReader log(path);
  for (LogRecord record; log.Next(record);) {
    records.push_back(
        {record.time_us, std::string(record.channel), {record.data.begin(), record.data.end()}});
  }
  return records;
}

// Renumbers the records, so that only the messages themselves reveal a fault.
void WriteRecords(const std::string& path, const Records& records) {
  std::filesystem::remove(path);
  EventLogWriter log(path);
  for (const Record& record : records) log.Write(record.time_us, record.channel, record.data);
  log.Finish();
}

// Text of the report about the log; the error message if there is no report.
std::string Said(const std::string& path) {
  SessionReporter reporter;
  const SessionLogSummary summary = ReadSessionLog(path, reporter.Handlers());
  try {
    SessionReport report = reporter.Finish([](const std::string&, int) {
      return Eigen::Matrix2d(Eigen::Vector2d(kMmPerCount, kRadPerCount).asDiagonal());
    });
    report.undecodable = summary.undecodable;
    report.unknown = summary.unknown;
    report.damage = summary.damage;
    std::string text = FormatReport(report);
    if (report.Good() && text.find("\n  log ") == std::string::npos) return "nothing";
    return text;
  } catch (const std::exception& error) {
    return error.what();
  }
}

// Indices of a channel's records, without the first and the last.
std::vector<std::size_t> Inner(const Records& records, const std::string& channel) {
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (records[i].channel == channel) places.push_back(i);
  }
  if (places.size() < 3) return {};
  return {places.begin() + 1, places.end() - 1};
}

}  // namespace

TEST_CASE("Missing, repeated and misordered messages of a log are reported") {
  const TemporaryFolder folder;
  SessionFaults faults;
  faults.running_counts = true;
  faults.course = true;
  faults.catheter = GENERATE(false, true);
  WriteSession(folder.Path("log"), faults);
  const Records whole = ReadRecords(folder.Path("log"));
  WriteRecords(folder.Path("log"), whole);
  REQUIRE(Said(folder.Path("log")) == "nothing");

  std::mt19937 random(26);
  const std::set<std::string> channels = {
      protocol::kDeviceSampleChannel, protocol::kInstrumentCommandChannel,
      protocol::kWireStateChannel,    protocol::kReadingsChannel,
      protocol::kHealthChannel,       protocol::kEmulatorTruthChannel};
  for (const std::string& channel : channels) {
    const std::vector<std::size_t> places = Inner(whole, channel);
    REQUIRE(!places.empty());
    for (const char* change : {"drop", "drop three", "rename", "rename all", "twice", "swap"}) {
      const std::string what = change;
      // The session is too short to detect a gap in these channels.
      const bool sparse =
          channel == protocol::kHealthChannel || channel == protocol::kReadingsChannel;
      if (what == "drop" && sparse) continue;
      if (what == "drop three" && channel == protocol::kHealthChannel) continue;
      const std::size_t k = random() % places.size();
      Records changed = whole;
      const auto place = changed.begin() + static_cast<std::ptrdiff_t>(places[k]);
      if (what == "drop") changed.erase(place);
      if (what == "drop three") {
        for (std::size_t last = std::min(k + 3, places.size()); last-- > k;) {
          changed.erase(changed.begin() + static_cast<std::ptrdiff_t>(places[last]));
        }
      }
      if (what == "rename") place->channel = "TORQUER_ANOTHER";
      if (what == "rename all") {
        for (Record& record : changed) {
          if (record.channel == channel) record.channel += "_OLD";
        }
      }
      if (what == "twice") changed.insert(place, Record(*place));
      if (what == "swap") {
        // Swaps with a message of the same size, since two boxes share a channel.
        for (std::size_t next = places[k] + 1; next < changed.size(); ++next) {
          if (changed[next].channel == channel && changed[next].time_us > place->time_us &&
              changed[next].data.size() == place->data.size()) {
            std::swap(changed[next].data, place->data);
            break;
          }
        }
        if (changed[places[k]].data == whole[places[k]].data) continue;
      }
      WriteRecords(folder.Path("changed"), changed);
      INFO(channel << ": " << what << " at record " << places[k]);
      CHECK(Said(folder.Path("changed")) != "nothing");
    }
  }
}

TEST_CASE("A sender without a name leaves no gap in a phrase") {
  for (const std::string& name : {std::string(), std::string("  ")}) {
    LogGaps gaps;
    for (const int i : {0, 1, 5, 5}) {
      torquer_lcm::hand_motion_t truth{};
      truth.device = name;
      truth.time_s = i;
      truth.publish_us = 1'000'000 * i;
      gaps.Add(truth);
      torquer_lcm::health_t health{};
      health.publish_us = truth.publish_us;
      health.process = name;
      gaps.Add(health);
      torquer_lcm::instrument_command_t command{};
      command.instrument = name;
      command.sequence = i;
      gaps.Add(command);
    }
    std::vector<std::string> lines = gaps.Describe();
    CHECK(lines.size() == 4);
    for (const std::string& line : gaps.DescribeSilences()) lines.push_back(line);
    CHECK(lines.size() == 6);
    for (const std::string& line : lines) {
      CHECK_THAT(line, !Catch::Contains(" of  ") && !Catch::Contains(" of at") &&
                           !Catch::EndsWith(" of") && !Catch::EndsWith(" "));
    }
  }
}

TEST_CASE("Two logs joined are two sessions, and no report judges them as one") {
  const TemporaryFolder folder;
  WriteSession(folder.Path("one"), {});
  WriteSession(folder.Path("other"), {});
  std::ofstream(folder.Path("both"), std::ios::binary)
      << Contents(folder.Path("one")) << Contents(folder.Path("other"));
  CHECK_THROWS_WITH(Said(folder.Path("both")), Catch::Contains("both: 2 logs are joined in it") &&
                                                   Catch::Contains("give each log by itself"));
}

TEST_CASE("A status or a scene that is missing between two others is reported") {
  for (const int dropped : {-1, 3, 4}) {
    LogGaps gaps;
    for (int i = 0; i < 10; ++i) {
      torquer_lcm::health_t health{};
      health.process = "simulator";
      health.state = "running";
      health.publish_us = 1'000'000 * i;
      if (i != 3 || dropped != 3) gaps.Add(health);
      if (i != 4 || dropped != 4) gaps.AddScene();
    }
    CHECK(gaps.Describe().empty() == (dropped < 0));
    CHECK(gaps.DescribeSilences().empty() == (dropped != 3));
  }
}
