#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "host/recorder/report_output.h"
#include "host/recorder/session_report.h"
#include "host/support/error.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

namespace {

// Gains that both boxes share.
Eigen::Matrix2d Gains(const std::string& device, int) {
  CHECK((device == kBox || device == kCatheterBox));
  return Eigen::Vector2d(kMmPerCount, kRadPerCount).asDiagonal();
}

SessionReport Report(const SessionFaults& faults) {
  const TemporaryFolder folder;
  WriteSession(folder.Path("log"), faults);
  SessionReporter reporter;
  const SessionLogSummary summary = ReadSessionLog(folder.Path("log"), reporter.Handlers());
  SessionReport report = reporter.Finish(Gains);
  report.undecodable = summary.undecodable;
  report.damage = summary.damage;
  report.unknown = summary.unknown;
  return report;
}

// Report on the guidewire.
InstrumentReport Wire(const SessionFaults& faults) { return Report(faults).instruments.at(0); }

}  // namespace

TEST_CASE("A session without fault") {
  const SessionReport report = Report({});
  CHECK(report.Good());
  CHECK(report.scene == "made_up");
  CHECK(report.duration_s == Approx(0.999));
  CHECK(report.states == kReports);
  CHECK(report.states_missing == 0);
  CHECK(report.max_penetration_um == 12.5);
  CHECK(report.readings.values == std::vector<double>{4, 10});
  CHECK_THAT(FormatReport(report),
             Catch::Contains("  readings     wall_force_events 4\n"
                             "               wall_force_largest_ever_mN 10.0 mN\n"));
  REQUIRE(report.instruments.size() == 1);
  const InstrumentReport& wire = report.instruments[0];
  CHECK(wire.name == "guidewire");
  CHECK(wire.device == kBox);
  CHECK(wire.driven());
  CHECK(wire.duration_s == Approx(0.999));
  CHECK(wire.reports_sent == kReports);
  CHECK(wire.reports_received == kReports);
  CHECK(wire.reports_lost == 0);
  CHECK(wire.samples == kReports);
  CHECK(wire.commands == kReports);
  CHECK(wire.axial.sensor_counts == kSensorCounts);
  CHECK(wire.axial.held_counts == kHeldCounts);
  CHECK(wire.axial.hand == Approx(kMmPerCount * (kSensorCounts - kHeldCounts)));
  CHECK(wire.axial.error_counts < 1e-3);  // float nodes
  CHECK(wire.rotation.error_counts < 1e-9);
  CHECK(wire.latency_ms.p50 == Approx(1));
  CHECK(wire.latency_ms.p99 == Approx(1));
  CHECK(wire.latency_ms.max == Approx(5));
}

TEST_CASE("Every instrument is judged by the box that drove it") {
  SessionFaults faults;
  faults.catheter = true;
  const SessionReport report = Report(faults);
  CHECK(report.Good());
  CHECK(report.states_missing == 0);
  REQUIRE(report.instruments.size() == 2);
  const InstrumentReport& wire = report.instruments[0];
  const InstrumentReport& catheter = report.instruments[1];
  CHECK(wire.device == kBox);
  CHECK(wire.axial.sensor_counts == kSensorCounts);
  CHECK(wire.axial.error_counts < 1e-3);
  CHECK(wire.latency_ms.p50 == Approx(1));
  CHECK(catheter.name == "catheter");
  CHECK(catheter.device == kCatheterBox);
  CHECK(catheter.samples == kReports);
  CHECK(catheter.commands == kReports);
  CHECK(catheter.reports_sent == kReports);
  CHECK(catheter.axial.sensor_counts == kReports - 1);
  CHECK(catheter.axial.held_counts == 0);
  CHECK(catheter.axial.wire == Approx(kMmPerCount * (kReports - 1)));
  CHECK(catheter.axial.error_counts < 1e-3);
  CHECK(catheter.latency_ms.p50 == Approx(3));
  CHECK(catheter.latency_ms.max == Approx(7));
  const std::string text = FormatReport(report);
  CHECK_THAT(text, Catch::Contains("  guidewire, driven by device BOX-1\n") &&
                       Catch::Contains("  catheter, driven by device BOX-2\n"));
  const auto json = nlohmann::json::parse(FormatReportJson(report, "", ""));
  REQUIRE(json["instruments"].size() == 2);
  CHECK(json["instruments"][0]["name"] == "guidewire");
  CHECK(json["instruments"][1]["name"] == "catheter");
  CHECK(json["instruments"][1]["device"] == kCatheterBox);
  CHECK(json["instruments"][1]["insertion_mm"].get<double>() ==
        Approx(kMmPerCount * (kReports - 1)));
}

TEST_CASE("A fault of one instrument spoils the session and is reported of that one alone") {
  SessionFaults faults;
  faults.catheter = true;
  SECTION("a lost report") { faults.catheter_lost_reports = 2; }
  SECTION("another way") { faults.extra_catheter_mm = 3 * kMmPerCount; }
  const SessionReport report = Report(faults);
  CHECK_FALSE(report.Good());
  CHECK(report.instruments.at(0).Good());
  CHECK_FALSE(report.instruments.at(1).Good());
  CHECK(report.instruments[1].reports_lost == faults.catheter_lost_reports);
  CHECK(report.instruments[1].axial.error_counts ==
        Approx(faults.extra_catheter_mm / kMmPerCount).margin(1e-3));
}

TEST_CASE("An instrument without a hand is named and not judged") {
  SessionFaults faults;
  faults.catheter = true;
  faults.catheter_box = false;
  const SessionReport report = Report(faults);
  CHECK(report.Good());
  REQUIRE(report.instruments.size() == 2);
  CHECK_FALSE(report.instruments[1].driven());
  CHECK_THAT(FormatReport(report),
             Catch::Contains("  catheter, driven by no device; 0 commands\n"));
}

TEST_CASE("A session steered by a page is reported, one without a hand is refused") {
  const TemporaryFolder folder;
  const std::string log = folder.Path("log");
  WriteSession(log, {});
  const auto report = [&log](bool commands) {
    SessionReporter reporter;
    SessionHandlers handlers = reporter.Handlers();
    handlers.sample = [](const torquer_lcm::device_sample_t&) {};
    handlers.health = [](const torquer_lcm::health_t&) {};
    handlers.truth = [](const torquer_lcm::hand_motion_t&) {};
    if (!commands) handlers.command = [](const torquer_lcm::instrument_command_t&) {};
    ReadSessionLog(log, handlers);
    return reporter.Finish([](const std::string&, int) -> Eigen::Matrix2d { throw 1; });
  };
  const SessionReport steered = report(true);
  CHECK(steered.Good());
  CHECK_FALSE(steered.instruments.at(0).driven());
  CHECK(steered.duration_s == Approx(1).epsilon(0.01));
  CHECK_THAT(FormatReport(steered),
             Catch::StartsWith("Session of 0:01.0 min in ") &&
                 Catch::Contains("  guidewire, driven by no device; 1000 commands\n"));
  CHECK_THROWS_WITH(report(false),
                    "the log holds no device sample and no command; record while "
                    "torquer-daemon or a page that steers runs");
}

TEST_CASE("The report has three digits, a unit and times as minutes and seconds") {
  SessionReport report = Report({});
  report.duration_s = 125.4321;
  report.residual = 1.23456e-5;
  report.max_penetration_um = 12.3456;
  report.solve_us.p50 = 312.4;
  report.instruments[0].axial.hand = 123.4567;
  report.instruments[0].axial.wire = -0.00004;
  report.instruments[0].axial.error_counts = 0.123456;
  report.instruments[0].latency_ms.p50 = 1.23456;
  report.readings.names = {"procedure_s",     "target_reached_s",  "catheter.hand_torque_mN_mm",
                           "retractions",     "air_kerma_mGy",     "wall_line_load_mN_mm",
                           "mean_speed_mm_s", "tip_path_ratio",    "safe_success",
                           "target_reached",  "wall_force_events", "wall_force_event_s",
                           "mask_lost_s",     "injector_rate_mL_s"};
  const double unknown = std::nan("");
  report.readings.values = {41.23456, unknown, 0.123456, 3,       123.456, 41.23456, 7.891234,
                            1.23456,  unknown, 0,        unknown, unknown, unknown,  4};
  const std::string text = FormatReport(report);
  for (const char* part :
       {"Session of 2:05 min in", "residual 1.23e-05, largest penetration 12.3 um", "p50 312 us",
        "which is +123 mm; guidewire +0 mm: 0.123 counts apart", "p50 1.23 ms",
        "procedure_s 0:41.2 min\n", "target_reached_s never\n",
        "catheter.hand_torque_mN_mm 0.123 mN mm\n", "retractions 3\n", "air_kerma_mGy 123 mGy\n",
        "wall_line_load_mN_mm 41.2 mN/mm\n", "mean_speed_mm_s 7.89 mm/s\n", "tip_path_ratio 1.23\n",
        "safe_success not known\n", "wall_force_event_s not known\n", "mask_lost_s never\n",
        "injector_rate_mL_s 4.00 mL/s\n"}) {
    CHECK_THAT(text, Catch::Contains(part));
  }
}

TEST_CASE("The report notes a machine that is too slow for real time") {
  SessionReport report = Report({});
  const auto hint = Catch::Contains("too busy for real time");
  CHECK_THAT(FormatReport(report), !hint);
  report.instruments[0].duration_s = 1.5;
  CHECK_THAT(FormatReport(report), hint && Catch::Contains("device's 0:01.0 min took 0:01.5 min"));
  // Without an emulator the number of sent reports is unknown.
  report.instruments[0].reports_sent.reset();
  CHECK_THAT(FormatReport(report), !hint);
}

TEST_CASE("A lost report is counted, by the emulator's count or by the report numbers") {
  SessionFaults faults;
  faults.lost_reports = 3;
  CHECK(Wire(faults).reports_lost == 3);
  CHECK_FALSE(Wire(faults).Good());
  CHECK_FALSE(Report(faults).Good());
  faults.without_emulator = true;
  CHECK(Wire(faults).reports_lost == 3);
}

TEST_CASE("A report that the daemon did not fetch is lost too, and counted apart") {
  SessionFaults faults;
  faults.lost_reports = 2;
  faults.unfetched_reports = 3;
  const SessionReport report = Report(faults);
  const InstrumentReport& wire = report.instruments.at(0);
  CHECK(wire.reports_unfetched == 3);
  CHECK(wire.reports_lost == 5);
  CHECK(wire.reports_sent == wire.reports_received.value() + 5);
  CHECK_THAT(FormatReport(report), Catch::Contains("5 lost") && Catch::Contains("3 of the lost"));
  CHECK_FALSE(report.Good());
  // Only the emulator can report which lost reports were not fetched.
  faults.without_emulator = true;
  CHECK(Wire(faults).reports_lost == 5);
}

TEST_CASE("A difference between wire and hand is reported in counts") {
  SessionFaults faults;
  faults.extra_wire_mm = 2.5 * kMmPerCount;
  CHECK(Wire(faults).axial.error_counts == Approx(2.5).margin(1e-3));
  CHECK_FALSE(Report(faults).Good());
  faults.extra_wire_mm = 0.5 * kMmPerCount;
  CHECK(Report(faults).Good());
}

TEST_CASE("Motion that was corrected at the end switch is reported, and is not an error") {
  SessionFaults faults;
  faults.extra_wire_mm = -1.5;
  CHECK_FALSE(Report(faults).Good());
  faults.healed_um = -1500;
  const SessionReport report = Report(faults);
  CHECK(report.Good());
  CHECK(report.instruments.at(0).axial.error_counts < 1e-3);
  CHECK_THAT(FormatReport(report),
             Catch::Contains("-1.50 mm were lost, and corrected at the end switch"));
  CHECK_THAT(FormatReport(Report({})), !Catch::Contains("end switch"));
}

TEST_CASE("Text of a log can neither steer the terminal nor leave the picture") {
  SessionReport report = Report({});
  const std::string hostile = "\x1b]0;x\x07<script>&\n";
  report.scene = report.method = hostile;
  report.description.vessel = hostile;
  report.readings.names.at(0) = hostile;
  report.instruments.at(0).name = report.instruments.at(0).device = hostile;
  report.last_state.instruments.at(0).name = hostile;
  const auto harmless = [](const std::string& text) {
    return std::none_of(text.begin(), text.end(),
                        [](char c) { return (c >= 0 && c < ' ' && c != '\n') || c == 0x7f; });
  };
  CHECK(harmless(FormatReport(report)));
  CHECK_THAT(FormatReport(report), Catch::Contains("\\x1b]0;x\\x07<script>&\\x0a"));
  CHECK(nlohmann::json::parse(FormatReportJson(report, "", "")).at("scene") == hostile);
  const std::string picture = DrawReport(report, {}, false);
  CHECK(harmless(picture));
  CHECK_THAT(picture, !Catch::Contains("<script"));
  report.instruments[0].name.clear();
  report.instruments[0].device.clear();
  CHECK(harmless(FormatReport(report)));
}

TEST_CASE("Motion while the daemon doubts the surface is held") {
  SessionFaults faults;
  faults.poor_surface = true;
  CHECK(Wire(faults).axial.held_counts == 2 * kHeldCounts);
  CHECK(Report(faults).Good());
}

TEST_CASE("A reset of the device does not count as motion") {
  SessionFaults faults;
  faults.reset = true;
  CHECK(Wire(faults).axial.sensor_counts == kSensorCounts - 2);
  CHECK(Report(faults).Good());
}

TEST_CASE("A device that restarts is reported as that, and not as a slow machine") {
  SessionFaults faults;
  faults.reset = true;
  SessionReport report = Report(faults);
  CHECK(report.instruments[0].resets == 1);
  // The restarted emulator counts its reports from zero again.
  report.instruments[0].reports_sent = 200;
  CHECK_THAT(FormatReport(report), Catch::Contains("device restarted once during the session") &&
                                       !Catch::Contains("too busy for real time"));
  CHECK_THAT(FormatReport(Report({})), !Catch::Contains("restarted"));
}

TEST_CASE("A state that was published again at rest counts once") {
  SessionFaults faults;
  faults.repeated_states = true;
  const SessionReport report = Report(faults);
  CHECK(report.Good());
  CHECK(report.states == kReports);
  CHECK(report.states_missing == 0);
  CHECK(report.solve_us.count == kReports);
  CHECK(report.instruments.at(0).latency_ms.count == kReports);
  CHECK(report.instruments.at(0).latency_ms.max == Approx(5));
}

TEST_CASE("Missing and undecodable states are counted") {
  SessionFaults faults;
  faults.lost_states = 4;
  faults.undecodable = true;
  const SessionReport report = Report(faults);
  CHECK(report.undecodable == 1);
  CHECK(report.states == kReports - 1);
  CHECK(report.states_missing == 4 + 1);
}

TEST_CASE("A message that cannot be decoded is a fault of the log") {
  SessionFaults faults;
  faults.undecodable = true;
  CHECK_FALSE(Report(faults).Good());
  CHECK(Report({}).Good());
}

TEST_CASE("A log that is cut anywhere accuses neither the device nor the instrument") {
  const TemporaryFolder folder;
  SessionFaults faults;
  faults.running_counts = true;
  WriteSession(folder.Path("whole"), faults);
  const auto size = std::filesystem::file_size(folder.Path("whole"));
  constexpr int kCuts = Rounds(97, 6);
  for (int i = 1; i <= kCuts; ++i) {
    INFO(i);
    std::filesystem::copy_file(folder.Path("whole"), folder.Path("log"),
                               std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(folder.Path("log"), size * static_cast<unsigned>(i) / (kCuts + 1));
    SessionReporter reporter;
    const SessionLogSummary summary = ReadSessionLog(folder.Path("log"), reporter.Handlers());
    SessionReport report = reporter.Finish(Gains);
    report.damage = summary.damage;
    CHECK_FALSE(report.ended);
    const InstrumentReport& wire = report.instruments.at(0);
    CHECK(wire.reports_lost.value_or(0) == 0);  // unknown before the daemon's first counts
    CHECK(wire.axial.error_counts < 0.01);
    CHECK(wire.rotation.error_counts < 0.01);
    CHECK(report.Good() == (wire.reports_lost == 0 && !report.damage.cut));
    CHECK_THAT(FormatReport(report), Catch::Contains("ends before the session"));
    if (report.damage.cut) CHECK_THAT(FormatReport(report), Catch::Contains("damaged: cut off"));
  }
  // A report counts as lost if the emulator sent it and the daemon lacked it at its last counts.
  faults.ended = false;
  faults.lost_reports = 5;
  CHECK(Wire(faults).reports_lost == 5);
}

TEST_CASE("A session that is stopped while the hand moves is judged by the shown states") {
  SessionFaults faults;
  faults.ended = false;
  CHECK(Wire(faults).axial.error_counts < 0.01);
  CHECK_FALSE(Report(faults).ended);
  CHECK(Report(faults).Good());
  CHECK(Report({}).ended);
  faults.extra_wire_mm = 2.5 * kMmPerCount;
  CHECK(Wire(faults).axial.error_counts == Approx(2.5).margin(1e-3));
}

TEST_CASE("A torn log is read to its last whole record") {
  const TemporaryFolder folder;
  WriteSession(folder.Path("log"), {});
  const auto whole = ReadSessionLog(folder.Path("log"), {}).messages;
  std::filesystem::resize_file(folder.Path("log"),
                               std::filesystem::file_size(folder.Path("log")) - 10);
  const SessionLogSummary torn = ReadSessionLog(folder.Path("log"), {});
  CHECK(torn.messages == whole - 1);
  CHECK(torn.damage.cut);
}

TEST_CASE("A damaged log is read past the damage, and is not good") {
  const TemporaryFolder folder;
  WriteSession(folder.Path("log"), {});
  const auto whole = ReadSessionLog(folder.Path("log"), {}).messages;
  std::fstream file(folder.Path("log"), std::ios::binary | std::ios::in | std::ios::out);
  file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(folder.Path("log")) / 2));
  file << std::string(40, '\xff');
  file.close();
  SessionReporter reporter;
  const SessionLogSummary summary = ReadSessionLog(folder.Path("log"), reporter.Handlers());
  SessionReport report = reporter.Finish(Gains);
  CHECK(summary.messages >= whole - 2);
  CHECK((summary.damage.any() || summary.undecodable > 0));
  report.damage = summary.damage;
  report.undecodable = summary.undecodable;
  CHECK_FALSE(report.Good());
}

TEST_CASE("A file that is not a log is refused by name") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(ReadSessionLog(folder.Path("none"), {}),
                    Catch::Contains("none: cannot be read"));
  std::ofstream(folder.Path("empty")).flush();
  CHECK_THROWS_WITH(ReadSessionLog(folder.Path("empty"), {}),
                    Catch::Contains("holds no LCM message"));
  CHECK_THROWS_WITH(SessionReporter().Finish(Gains), Catch::Contains("no scene description"));
}

TEST_CASE("Order statistics are by nearest rank") {
  std::vector<double> hundred;
  for (int i = 100; i >= 1; --i) hundred.push_back(i);
  const Distribution distribution = Distribute(hundred);
  CHECK(distribution.count == 100);
  CHECK(distribution.p50 == 50);
  CHECK(distribution.p99 == 99);
  CHECK(distribution.p999 == 100);
  CHECK(distribution.max == 100);
  std::vector<double> one{4.0};
  CHECK(Distribute(one).p99 == 4);
  std::vector<double> none;
  CHECK(Distribute(none).count == 0);
  CHECK(std::isnan(Distribute(none).p50));
}
