// Figures of a session that its log does not show are null in JSON, and not known in text.

#include <algorithm>
#include <catch2/catch.hpp>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>

#include "host/recorder/report_output.h"
#include "host/recorder/report_page.h"
#include "host/recorder/session_report.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

namespace {

// `health`: false for a log without the daemon's counts.
SessionReport ReportWithFaults(const SessionFaults& faults, bool health = true) {
  const TemporaryFolder folder;
  WriteSession(folder.Path("log"), faults);
  SessionReporter reporter;
  SessionHandlers handlers = reporter.Handlers();
  if (!health) handlers.health = [](const torquer_lcm::health_t&) {};
  ReadSessionLog(folder.Path("log"), handlers);
  return reporter.Finish([](const std::string&, int) -> Eigen::Matrix2d {
    return Eigen::Vector2d(kMmPerCount, kRadPerCount).asDiagonal();
  });
}

// Checks that in the JSON of a report these fields of an instrument are null, and all others known.
void CheckUnknown(const SessionReport& report, std::size_t instrument,
                  std::initializer_list<const char*> names) {
  const auto json =
      nlohmann::json::parse(FormatReportJson(report, "", ""))["instruments"].at(instrument);
  for (const auto& [name, value] : json.items()) {
    INFO(name);
    const bool unknown = std::find(names.begin(), names.end(), name) != names.end();
    CHECK(value.is_null() == unknown);
  }
}

auto DeviceRow(const std::string& name, const std::string& value) {
  return Catch::Contains("<tr><td>" + name + "</td><td class=\"number\">" + value + "</td></tr>");
}

}  // namespace

TEST_CASE("A session with all counts has no unknown figure") {
  CheckUnknown(ReportWithFaults({}), 0, {});
}

TEST_CASE("The motion of an instrument without a device is not known") {
  SessionFaults faults;
  faults.catheter = true;
  faults.catheter_box = false;
  CheckUnknown(
      ReportWithFaults(faults), 1,
      {"reports_sent", "reports_received", "reports_lost", "reports_unfetched", "healed_mm",
       "motion_error_counts", "rotation_error_counts", "insertion_mm", "rotation_rad",
       "latency_ms_p50", "latency_ms_p99", "latency_ms_p999", "latency_ms_max"});
}

TEST_CASE("Only an emulator counts the reports that were sent, and those that were not fetched") {
  SessionFaults faults;
  faults.without_emulator = true;
  CheckUnknown(ReportWithFaults(faults), 0, {"reports_sent", "reports_unfetched"});
}

TEST_CASE("Counts that the daemon has not reported are not known") {
  const SessionReport report = ReportWithFaults({}, false);
  CHECK_FALSE(report.Good());
  CheckUnknown(
      report, 0,
      {"reports_sent", "reports_received", "reports_lost", "reports_unfetched", "healed_mm"});
  CHECK_THAT(FormatReport(report), Catch::Contains("? sent, ? received, ? lost\n"));
  CHECK_THAT(FormatPage(report, PageParts()),
             Catch::Contains("may have lost reports of its device") &&
                 DeviceRow("guidewire: reports of the device lost", "not known"));
}

TEST_CASE("Latency between the clocks of two machines is not known") {
  SessionFaults faults;
  faults.foreign_clock = true;
  const SessionReport report = ReportWithFaults(faults);
  CHECK(report.instruments.at(0).latency_ms.count == 0);
  CheckUnknown(report, 0,
               {"latency_ms_p50", "latency_ms_p99", "latency_ms_p999", "latency_ms_max"});
  CHECK_THAT(FormatReport(report), Catch::Contains("sensor to wire state: not known\n"));
  CHECK_THAT(FormatPage(report, PageParts()),
             DeviceRow("guidewire: from hand to simulation", "not known"));
  CHECK_THAT(DrawReport(report, PictureVessel(), false), Catch::Contains(">not known<"));
}

TEST_CASE("A tip that never moved has no speed") {
  SessionCourse course;
  torquer_lcm::wire_state_t state{};
  state.instruments.resize(1);
  for (int k = 0; k < 20; ++k) {
    state.tick = k;
    state.time_s = 0.1 * k;
    course.Add(state);
  }
  CHECK_FALSE(course.moving_speed_mm_s());
  SessionReport report = ReportWithFaults({});
  report.course = course;
  CHECK_THAT(FormatPage(report, PageParts()),
             DeviceRow("Speed of the tip while it moved", "it did not move"));
}
