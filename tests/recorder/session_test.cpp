#include <sys/wait.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "calibration/calibration_file.h"
#include "host/recorder/report_output.h"
#include "host/recorder/session_report.h"
#include "host/support/error.h"
#include "protocol/lcm_channels.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

namespace {

SessionReport Report(const SessionFaults& faults) {
  const TemporaryFolder folder;
  WriteSession(folder.Path("log"), faults);
  SessionReporter reporter(protocol::kGuidewire);
  const SessionLogSummary summary = ReadSessionLog(folder.Path("log"), reporter.Handlers());
  SessionReport report =
      reporter.Finish(Eigen::Vector2d(kMmPerCount, kRadPerCount).asDiagonal().toDenseMatrix());
  report.undecodable = summary.undecodable;
  return report;
}

}  // namespace

TEST_CASE("A session without fault") {
  const SessionReport report = Report({});
  CHECK(report.Good());
  CHECK(report.scene == "made_up");
  CHECK(report.duration_s == Approx(0.999));
  CHECK(report.reports_sent == kReports);
  CHECK(report.reports_received == kReports);
  CHECK(report.reports_lost == 0);
  CHECK(report.samples == kReports);
  CHECK(report.commands == kReports);
  CHECK(report.states == kReports);
  CHECK(report.states_missing == 0);
  CHECK(report.axial.sensor_counts == kSensorCounts);
  CHECK(report.axial.held_counts == kHeldCounts);
  CHECK(report.axial.hand == Approx(kMmPerCount * (kSensorCounts - kHeldCounts)));
  CHECK(report.axial.error_counts < 1e-3);  // float nodes
  CHECK(report.rotation.error_counts < 1e-9);
  CHECK(report.max_penetration_um == 12.5);
  CHECK(report.latency_ms.p50 == Approx(1));
  CHECK(report.latency_ms.p99 == Approx(1));
  CHECK(report.latency_ms.max == Approx(5));
  CHECK(report.readings.values == std::vector<double>{4, 10});
  CHECK_THAT(FormatReport(report),
             Catch::Contains("  readings     wall_force_events 4\n"
                             "               wall_force_largest_ever_mN 10\n"));
}

TEST_CASE("Of a machine too slow for real time it is said so") {
  SessionReport report = Report({});
  const auto hint = Catch::Contains("too busy for real time");
  CHECK_THAT(FormatReport(report), !hint);
  report.duration_s = 1.5;
  CHECK_THAT(FormatReport(report), hint && Catch::Contains("1.0 s took 1.5 s"));
  // Without an emulator nobody knows how much there was.
  report.reports_sent = -1;
  CHECK_THAT(FormatReport(report), !hint);
}

TEST_CASE("A lost report is told, by the emulator's count or by the report numbers") {
  SessionFaults faults;
  faults.lost_reports = 3;
  CHECK(Report(faults).reports_lost == 3);
  CHECK_FALSE(Report(faults).Good());
  faults.without_emulator = true;
  CHECK(Report(faults).reports_sent == -1);
  CHECK(Report(faults).reports_lost == 3);
}

TEST_CASE("A report that the daemon did not fetch is lost too, and told apart") {
  SessionFaults faults;
  faults.lost_reports = 2;
  faults.unfetched_reports = 3;
  const SessionReport report = Report(faults);
  CHECK(report.reports_unfetched == 3);
  CHECK(report.reports_lost == 5);
  CHECK(report.reports_sent == report.reports_received + 5);
  CHECK_THAT(FormatReport(report), Catch::Contains("5 lost") && Catch::Contains("3 of the lost"));
  CHECK_FALSE(report.Good());
  // Whether it was fetched, only the emulator can tell.
  faults.without_emulator = true;
  CHECK(Report(faults).reports_lost == 5);
}

TEST_CASE("A wire that goes elsewhere than the hand is told in counts") {
  SessionFaults faults;
  faults.extra_wire_mm = 2.5 * kMmPerCount;
  const SessionReport report = Report(faults);
  CHECK(report.axial.error_counts == Approx(2.5).margin(1e-3));
  CHECK_FALSE(report.Good());
  faults.extra_wire_mm = 0.5 * kMmPerCount;
  CHECK(Report(faults).Good());
}

TEST_CASE("Motion while the daemon doubts the surface is held") {
  SessionFaults faults;
  faults.poor_surface = true;
  const SessionReport report = Report(faults);
  CHECK(report.axial.held_counts == 2 * kHeldCounts);
  CHECK(report.Good());
}

TEST_CASE("A reset of the device is no motion") {
  SessionFaults faults;
  faults.reset = true;
  const SessionReport report = Report(faults);
  CHECK(report.axial.sensor_counts == kSensorCounts - 2);
  CHECK(report.Good());
}

TEST_CASE("Latency is not computed between the clocks of two machines") {
  SessionFaults faults;
  faults.foreign_clock = true;
  CHECK(Report(faults).latency_ms.count == 0);
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

TEST_CASE("A torn log is read to its last whole record") {
  const TemporaryFolder folder;
  WriteSession(folder.Path("log"), {});
  const auto whole = ReadSessionLog(folder.Path("log"), {}).messages;
  std::filesystem::resize_file(folder.Path("log"),
                               std::filesystem::file_size(folder.Path("log")) - 10);
  CHECK(ReadSessionLog(folder.Path("log"), {}).messages == whole - 1);
}

TEST_CASE("What is no log is refused by name") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(ReadSessionLog(folder.Path("none"), {}),
                    Catch::Contains("none: cannot be read"));
  std::ofstream(folder.Path("empty")).flush();
  CHECK_THROWS_WITH(ReadSessionLog(folder.Path("empty"), {}),
                    Catch::Contains("holds no LCM message"));
  CHECK_THROWS_WITH(SessionReporter("catheter").Finish(Eigen::Matrix2d::Identity()),
                    Catch::Contains("no scene description"));
}

TEST_CASE("Order statistics are by nearest rank") {
  std::vector<double> hundred;
  for (int i = 100; i >= 1; --i) hundred.push_back(i);
  const Distribution distribution = Distribute(hundred);
  CHECK(distribution.count == 100);
  CHECK(distribution.p50 == 50);
  CHECK(distribution.p99 == 99);
  CHECK(distribution.max == 100);
  std::vector<double> one{4.0};
  CHECK(Distribute(one).p99 == 4);
  std::vector<double> none;
  CHECK(Distribute(none).count == 0);
}

TEST_CASE("torquer-report judges, prints and draws") {
  const TemporaryFolder folder;
  calibration::Calibration calibration = calibration::NominalCalibration("made-up", 1200);
  calibration.motion.per_count = {{{kMmPerCount, 0.0}, {0.0, kRadPerCount}}};
  calibration::WriteCalibration(calibration, folder.Path("calibration.toml"));
  const auto run = [&folder](const std::string& arguments) {
    const std::string command = ProgramPath("torquer-report") + " " + arguments + " >" +
                                folder.Path("out") + " 2>" + folder.Path("err");
    return WEXITSTATUS(std::system(command.c_str()));
  };
  const auto text = [&folder](const std::string& name) {
    std::ostringstream all;
    all << std::ifstream(folder.Path(name)).rdbuf();
    return all.str();
  };
  const std::string given =
      folder.Path("log") + " --calibration " + folder.Path("calibration.toml");

  WriteSession(folder.Path("log"), {});
  const std::string drawn = given + " --json --picture " + folder.Path("wire.svg");
  CHECK(run(drawn) == 2);
  CHECK_THAT(text("err"), Catch::Contains("made_up.toml"));
  REQUIRE(run(drawn + " --scene " + SourcePath("/host/scenes/ty_phantom.toml")) == 0);
  const auto json = nlohmann::json::parse(text("out"));
  for (const char* key :
       {"reports_sent", "reports_received", "reports_lost", "motion_error_counts", "latency_ms_p50",
        "latency_ms_p99", "max_penetration_um", "nodes", "residual", "picture"}) {
    CHECK(json.contains(key));
  }
  CHECK(json["nodes"] == 4);
  CHECK(json["readings"]["wall_force_largest_ever_mN"] == 10);
  CHECK(json["picture"] == folder.Path("wire.svg"));
  CHECK_THAT(text("wire.svg"), Catch::StartsWith("<svg") && Catch::EndsWith("</svg>\n") &&
                                   Catch::Contains("tube &lt;r 3&gt;"));

  SessionFaults faults;
  faults.lost_reports = 1;
  WriteSession(folder.Path("log"), faults);
  CHECK(run(given) == 1);
  CHECK_THAT(text("out"), Catch::Contains("1001 sent, 1000 received, 1 lost"));

  CHECK(run(folder.Path("none")) == 2);
  CHECK_THAT(text("err"), Catch::StartsWith("torquer-report: ") && Catch::Contains("none"));
  CHECK(run("") == 2);
  CHECK(run(given + " --nonsense") == 2);
  CHECK_THAT(text("err"), Catch::Contains("--nonsense"));
}
