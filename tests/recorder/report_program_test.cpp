// torquer-report as a program: judgment, output, picture and errors.
#include <sys/wait.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "calibration/calibration_file.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

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
  REQUIRE(run(drawn + " --scene " + SourcePath("/host/scenes/drill_tube.toml")) == 0);
  const auto json = nlohmann::json::parse(text("out"));
  REQUIRE(json["instruments"].size() == 1);
  for (const char* key :
       {"name", "device", "reports_sent", "reports_received", "reports_lost", "motion_error_counts",
        "latency_ms_p50", "latency_ms_p99", "latency_ms_p999"}) {
    CHECK(json["instruments"][0].contains(key));
  }
  for (const char* key : {"max_penetration_um", "nodes", "residual", "picture"}) {
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

  // Pass marks: no mark without a replay, and a file that cannot be used ends the program.
  faults = {};
  faults.course = true;
  WriteSession(folder.Path("log"), faults);
  std::ofstream(folder.Path("marks.toml")) << "target_reached = true\n";
  CHECK(run(given + " --json --marks " + folder.Path("marks.toml")) == 0);
  const auto marked = nlohmann::json::parse(text("out"));
  CHECK_THAT(marked["not_gradable"].get<std::string>(), Catch::Contains("made_up.toml"));
  CHECK(marked["passed"].is_null());
  CHECK(marked["marks"][0]["passed"].is_null());
  std::ofstream(folder.Path("marks.toml")) << "reached = true\n";
  CHECK(run(given + " --marks " + folder.Path("marks.toml")) == 2);
  CHECK_THAT(text("err"), Catch::Contains("marks.toml:1: reached"));

  CHECK(run(folder.Path("none")) == 2);
  CHECK_THAT(text("err"), Catch::StartsWith("torquer-report: ") && Catch::Contains("none"));
  CHECK(run("") == 2);
  CHECK(run(given + " --nonsense") == 2);
  CHECK_THAT(text("err"), Catch::Contains("--nonsense"));
}
