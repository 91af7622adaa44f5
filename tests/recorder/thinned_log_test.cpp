// Logs with fewer shapes than ticks, and logs in parts.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "host/bus/message_check.h"
#include "host/bus/state_outline.h"
#include "host/recorder/report_output.h"
#include "host/recorder/rotating_log.h"
#include "host/recorder/session_report.h"
#include "host/recorder/shape_thinner.h"
#include "host/support/event_log.h"
#include "host/support/event_log_writer.h"
#include "protocol/lcm_channels.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

namespace {

// Thins the fixture's session to `shapes_hz`. With `pay` the log ends with the shape that the
// recorder still owes, as the recorder ends it.
void Thin(const std::string& from, const std::string& to, double shapes_hz, bool pay) {
  ShapeThinner thinner(shapes_hz);
  EventLogReader log(from);
  EventLogWriter out(to);
  std::int64_t time_us = 0;
  for (LogRecord record; log.Next(record);) {
    const bool is_state = record.channel == protocol::kWireStateChannel;
    time_us = record.time_us;
    out.Write(time_us, record.channel, is_state ? thinner.Take(record.data, time_us) : record.data);
  }
  if (pay) out.Write(time_us, protocol::kWireStateChannel, thinner.Owed());
  out.Finish();
}

SessionReport ReportOf(const std::string& log) {
  SessionReporter reporter;
  const SessionLogSummary summary = ReadSessionLog(log, reporter.Handlers());
  SessionReport report = reporter.Finish([](const std::string&, int) -> Eigen::Matrix2d {
    return Eigen::Vector2d(kMmPerCount, kRadPerCount).asDiagonal();
  });
  report.undecodable = summary.undecodable;
  report.damage = summary.damage;
  return report;
}

torquer_lcm::wire_state_t StateOf(std::int64_t tick, int segments) {
  torquer_lcm::wire_state_t state{};
  state.tick = tick;
  state.state_hash = 1000 + tick;
  state.segment_count = segments;
  state.stride = 1;
  for (int i = 0; i <= segments; ++i) state.nodes_mm.push_back({1.0F * i, 2.0F, 3.0F});
  state.node_count = segments + 1;
  state.instruments.resize(1);
  state.instrument_count = 1;
  state.instruments[0].nodes_mm = {{0, 6, 0}, {0, 7, 0}, {0, 8, 0}};
  state.instruments[0].node_count = 3;
  state.contact_nodes = {1};
  state.contact_penetrations_um = {5};
  state.contact_count = 1;
  state.past_count = 2;
  state.past_time_s = {1, 2};
  state.past_work = {3, 4};
  state.past_insertion_mm = state.past_rotation_rad = {{0}, {0}};
  return state;
}

std::vector<std::uint8_t> BytesOfState(const torquer_lcm::wire_state_t& state) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(state.getEncodedSize()));
  state.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

torquer_lcm::wire_state_t Taken(ShapeThinner& thinner, const torquer_lcm::wire_state_t& state,
                                std::int64_t time_us) {
  const std::vector<std::uint8_t> whole = BytesOfState(state);
  const auto bytes = thinner.Take(whole, time_us);
  torquer_lcm::wire_state_t taken{};
  REQUIRE(bus::DecodeMessage(bytes.data(), bytes.size(), taken));
  return taken;
}

}  // namespace

TEST_CASE("A thinned log is judged like the whole one, and reports its number of shapes") {
  const TemporaryFolder folder;
  SessionFaults faults;
  faults.catheter = true;
  faults.course = true;
  WriteSession(folder.Path("whole"), faults);
  Thin(folder.Path("whole"), folder.Path("thin"), 60, true);
  CHECK(std::filesystem::file_size(folder.Path("thin")) <
        std::filesystem::file_size(folder.Path("whole")));
  const SessionReport whole = ReportOf(folder.Path("whole"));
  const SessionReport thin = ReportOf(folder.Path("thin"));
  CHECK(whole.shapes == whole.states);
  CHECK(thin.Good());
  CHECK(thin.states == whole.states);
  CHECK(thin.shapes == 1 + (kReports - 1) / 17 + 1);  // every 17 ms, and the last
  CHECK(thin.states_missing == 0);
  CHECK(thin.ticks_after_shape == 0);
  CHECK(thin.max_penetration_um == whole.max_penetration_um);
  CHECK(thin.residual == whole.residual);
  CHECK(thin.course.tip_path_mm() == whole.course.tip_path_mm());
  CHECK(thin.last_state.nodes_mm == whole.last_state.nodes_mm);
  for (std::size_t k = 0; k < 2; ++k) {
    CHECK(thin.instruments[k].axial.wire == whole.instruments[k].axial.wire);
    CHECK(thin.instruments[k].axial.error_counts == whole.instruments[k].axial.error_counts);
    CHECK(thin.instruments[k].latency_ms.count == whole.instruments[k].latency_ms.count);
  }
  CHECK_THAT(FormatReport(whole), !Catch::Contains("shapes"));
  CHECK_THAT(FormatReport(thin), Catch::Contains("shapes       of 60 of the states"));
}

TEST_CASE("A thinned log without a shape at its end is judged by the last one that it has") {
  const TemporaryFolder folder;
  SessionFaults faults;
  WriteSession(folder.Path("whole"), faults);
  Thin(folder.Path("whole"), folder.Path("killed"), 10, false);
  const SessionReport killed = ReportOf(folder.Path("killed"));
  CHECK(killed.Good());
  CHECK(killed.ticks_after_shape == 99);
  CHECK(killed.instruments[0].axial.error_counts < 0.01);
  CHECK(killed.instruments[0].axial.sensor_counts == kSensorCounts - 2 * 99);
  CHECK_THAT(FormatReport(killed), Catch::Contains("ends 99 ticks after its last shape"));
  // A wire that moves without its hand is detected all the same.
  faults.extra_wire_mm = 2.5 * kMmPerCount;
  WriteSession(folder.Path("astray"), faults);
  Thin(folder.Path("astray"), folder.Path("thin astray"), 10, false);
  CHECK(ReportOf(folder.Path("thin astray")).instruments[0].axial.error_counts ==
        Approx(2.5).margin(0.01));
}

TEST_CASE("The nodes of an instrument beside the wire go through a log into report and picture") {
  const TemporaryFolder folder;
  SessionFaults faults;
  faults.catheter = faults.beside = true;
  WriteSession(folder.Path("log"), faults);
  Thin(folder.Path("log"), folder.Path("thin"), 10, true);
  for (const char* log : {"log", "thin"}) {
    const SessionReport report = ReportOf(folder.Path(log));
    const torquer_lcm::instrument_state_t& beside = report.last_state.instruments.at(1);
    REQUIRE(beside.nodes_mm.size() == 3);
    CHECK(ArcLengthMm(report.last_state, 1) == Approx(beside.insertion_mm).margin(1e-4));
    CHECK(report.instruments[1].axial.error_counts < 1e-3);
    const long end = std::lround(100 * beside.insertion_mm);
    CHECK_THAT(DrawReport(report, {}, false),
               Catch::Contains(" 0 " + std::to_string(end) + " 0\""));
  }
}

TEST_CASE("Between shapes a state keeps its ends, and its past where that is needed") {
  ShapeThinner thinner(10);
  const torquer_lcm::wire_state_t first = StateOf(5, 4);
  CHECK(BytesOfState(Taken(thinner, first, 0)) == BytesOfState(first));
  CHECK(thinner.Owed().empty());
  torquer_lcm::wire_state_t taken = Taken(thinner, StateOf(6, 4), 1000);
  CHECK(bus::IsOutline(taken));
  CHECK(taken.state_hash == 1006);
  REQUIRE(taken.nodes_mm.size() == 2);
  CHECK(taken.nodes_mm[0][0] == 0);
  CHECK(taken.nodes_mm[1][0] == 4);
  REQUIRE(taken.instruments.at(0).nodes_mm.size() == 2);
  CHECK(taken.instruments[0].node_count == 2);
  CHECK(taken.instruments[0].nodes_mm[1][1] == 8);
  CHECK(taken.contact_count == 0);
  CHECK(taken.past_count == 0);
  CHECK(thinner.Owed().size() == BytesOfState(StateOf(6, 4)).size());
  // A gap in the ticks.
  taken = Taken(thinner, StateOf(8, 4), 2000);
  CHECK(bus::IsOutline(taken));
  CHECK(taken.past_count == 2);
  for (int tick = 9; tick < 8 + ShapeThinner::kPastTicks; ++tick) {
    CHECK(Taken(thinner, StateOf(tick, 4), 3000).past_count == 0);
  }
  CHECK(Taken(thinner, StateOf(8 + ShapeThinner::kPastTicks, 4), 3000).past_count == 2);
  CHECK_FALSE(bus::IsOutline(Taken(thinner, StateOf(25, 4), 100'000)));
  thinner.WantShape();
  CHECK_FALSE(bus::IsOutline(Taken(thinner, StateOf(26, 4), 100'001)));
  // Another run of the simulator; then a wire of one segment, which consists of its ends only.
  CHECK(Taken(thinner, StateOf(0, 4), 100'002).past_count == 2);
  CHECK(Taken(thinner, StateOf(1, 1), 100'003).contact_count == 1);
  const std::vector<std::uint8_t> broken{1, 2, 3};
  CHECK(thinner.Take(broken, 100'004).data() == broken.data());
}

TEST_CASE("A log continues in parts, and keeps the newest") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("log");
  const std::vector<std::uint8_t> data(1000, 7);
  const int keep = GENERATE(0, 2);
  RotatingLog log(path, 10'000, keep);
  int parts = 1;
  for (int k = 0; k < 45; ++k) {
    log.Write(k, "CHANNEL", data);
    if (log.Rotate()) ++parts;
  }
  log.Finish();
  CHECK(parts == 5);
  CHECK(log.parts() == 5);
  CHECK(log.records() == 45);
  CHECK(log.bytes() == 45 * (28 + 7 + 1000));
  EventLogReader reader(path);
  std::vector<std::int64_t> numbers;
  for (LogRecord record; reader.Next(record);) numbers.push_back(record.number);
  CHECK_FALSE(reader.damage().any());
  CHECK(numbers.back() == 44);
  CHECK(log.removed() == (keep == 0 ? 0 : 3));
  CHECK(numbers.size() == (keep == 0 ? 45 : 15));
}

TEST_CASE("A recording that ends with an empty part still has the records before it") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("log");
  const std::vector<std::uint8_t> data(1000, 7);
  RotatingLog log(path, 10'000, 1);
  for (int k = 0; k < 10; ++k) log.Write(k, "CHANNEL", data);
  REQUIRE(log.Rotate());
  const auto kept = [&] {
    EventLogReader reader(path);
    std::int64_t records = 0;
    for (LogRecord record; reader.Next(record);) ++records;
    return records;
  };
  CHECK_FALSE(log.Rotate());
  CHECK(kept() == 10);
  // With its first record on the disk, the new part replaces the old one.
  log.Write(10, "CHANNEL", data);
  CHECK_FALSE(log.Rotate());
  CHECK(kept() == 1);
  CHECK(log.removed() == 1);
}

TEST_CASE("A log does not start beside parts of another log with its name") {
  const TemporaryFolder folder;
  std::ofstream(folder.Path("log.part007")) << "another's";
  CHECK_THROWS_WITH(RotatingLog(folder.Path("log"), 0, 0),
                    Catch::Contains("log.part007: exists already"));
  CHECK_FALSE(std::filesystem::exists(folder.Path("log")));
}

TEST_CASE("A log that begins in the middle of a session is judged from there") {
  const TemporaryFolder folder;
  SessionFaults faults;
  faults.ended = GENERATE(true, false);
  // An error before the log begins does not count.
  faults.extra_wire_mm = 7;
  faults.running_counts = true;
  WriteSession(folder.Path("whole"), faults);
  const auto begin = [&](int from) {
    const std::string path = folder.Path("from" + std::to_string(from));
    EventLogReader log(folder.Path("whole"));
    EventLogWriter out(path, from);
    for (LogRecord record; log.Next(record);) {
      if (record.number >= from || record.channel == protocol::kSceneChannel) {
        out.Write(record.time_us, record.channel, record.data);
      }
    }
    out.Finish();
    return ReportOf(path);
  };
  CHECK(begin(0).instruments[0].axial.error_counts == Approx(7 / kMmPerCount).margin(1e-2));
  // The result is the same for any first record.
  for (int from = 1500; from < 1510; ++from) {
    const SessionReport report = begin(from);
    CHECK(report.first_tick > 300);
    CHECK(report.instruments[0].axial.error_counts < 0.01);
    CHECK(report.instruments[0].rotation.error_counts < 0.01);
    CHECK_THAT(FormatReport(report), Catch::Contains("begins with tick "));
  }
}
