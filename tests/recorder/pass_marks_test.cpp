#include "host/recorder/pass_marks.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "host/recorder/report_output.h"
#include "host/recorder/report_page.h"
#include "host/recorder/session_report.h"
#include "host/recorder/session_summary.h"
#include "host/simulator/scene/scene_spec.h"
#include "host/support/error.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

namespace {

constexpr char kMarksOfTrainer[] =
    "target_reached = true\n"
    "[at_most]\n"
    "time_to_target_s = 90\n"
    "largest_force_mN = 300\n"
    "wrong_vessels = 0\n";

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// `reached_s`: NaN if the target was not reached.
SessionReport MarkedReport(double reached_s, double force_mN, double wrong) {
  SessionReport report;
  report.scene = "made_up";
  report.description.effects = {"wall_force", "assessment"};
  report.readings.names = {"target_reached", "target_reached_s", "wall_force_largest_ever_mN",
                           "wrong_vessel_entries", "safe_success"};
  report.readings.values = {std::isnan(reached_s) ? 0.0 : 1.0, reached_s, force_mN, wrong, 1};
  return report;
}

void WriteMarks(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

MarkSheet Compared(const std::string& path, const SessionReport& report) {
  MarkSheet sheet = ReadMarks(path, report);
  CompareMarks(report, sheet);
  return sheet;
}

}  // namespace

TEST_CASE("A session passes if it has every pass mark, a value at the limit included") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("marks.toml");
  WriteMarks(path, kMarksOfTrainer);
  const MarkSheet good = Compared(path, MarkedReport(90, 300, 0));
  CHECK(good.Passed() == true);
  REQUIRE(good.marks.size() == 4);
  CHECK(good.marks[1].limit == "at most 1:30.0 min");
  CHECK(good.marks[2].found == "300 mN");

  const MarkSheet hard = Compared(path, MarkedReport(90, 300.5, 0));
  CHECK(hard.Passed() == false);
  CHECK(hard.marks[1].passed == true);
  CHECK(hard.marks[2].passed == false);
  CHECK(Compared(path, MarkedReport(90, 20, 1)).Passed() == false);
}

TEST_CASE("A missed target fails its marks, and an unknown value neither passes nor fails") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("marks.toml");
  WriteMarks(path, kMarksOfTrainer);
  const MarkSheet missed = Compared(path, MarkedReport(kUnknown, 20, 0));
  CHECK(missed.Passed() == false);
  CHECK(missed.marks[0].passed == false);
  CHECK(missed.marks[1].passed == false);
  CHECK_FALSE(missed.marks[1].value.has_value());
  CHECK(missed.marks[1].found == "never");

  SessionReport doubt = MarkedReport(kUnknown, 20, 0);
  doubt.readings.values[0] = kUnknown;
  const MarkSheet doubtful = Compared(path, doubt);
  CHECK_FALSE(doubtful.Passed().has_value());
  CHECK_FALSE(doubtful.marks[1].passed.has_value());
  CHECK(doubtful.marks[1].found == "not known");

  const MarkSheet unknown = Compared(path, MarkedReport(20, kUnknown, 0));
  CHECK_FALSE(unknown.Passed().has_value());
  CHECK_FALSE(unknown.marks[2].passed.has_value());
  CHECK(unknown.marks[2].found == "not known");
  // One failed mark decides, whatever is not known.
  CHECK(Compared(path, MarkedReport(20, kUnknown, 3)).Passed() == false);

  SessionReport report = MarkedReport(20, 20, 0);
  report.not_gradable = "the recording is damaged";
  const MarkSheet none = Compared(path, report);
  CHECK_FALSE(none.Passed().has_value());
  for (const Mark& mark : none.marks) CHECK_FALSE(mark.passed.has_value());
}

TEST_CASE(
    "A mark of converged ticks alone can be failed and not passed if others did not converge") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("marks.toml");
  WriteMarks(path, std::string(kMarksOfTrainer) + "force_events = 2\npath_ratio = 3\n");
  const auto after = [&](double unconverged_s, double force_mN, double wrong) {
    SessionReport report = MarkedReport(20, force_mN, wrong);
    for (const auto& [name, value] : {std::pair("wall_force_events", 1.0),
                                      {"tip_path_ratio", 1.2},
                                      {"wall_force_unconverged_s", unconverged_s}}) {
      report.readings.names.emplace_back(name);
      report.readings.values.push_back(value);
    }
    return Compared(path, report);
  };
  CHECK(after(0, 20, 0).Passed() == true);
  const MarkSheet doubt = after(0.004, 20, 0);
  CHECK_FALSE(doubt.Passed().has_value());
  for (const Mark& mark : doubt.marks) {
    CAPTURE(mark.name);
    const bool is_of_time = mark.name == "target_reached" || mark.name == "time_to_target_s";
    CHECK(mark.passed.has_value() == is_of_time);
    CHECK((mark.found.find("at least ") == 0) == !is_of_time);
  }
  CHECK(after(0.004, 301, 0).Passed() == false);
  CHECK(after(0.004, 20, 1).Passed() == false);
}

TEST_CASE("Pass marks that cannot be used are refused with file, line and key") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("marks.toml");
  const auto refuses = [&](const std::string& text, const std::string& where,
                           const std::string& what) {
    WriteMarks(path, text);
    CHECK_THROWS_WITH(ReadMarks(path, MarkedReport(1, 1, 0)),
                      Catch::StartsWith(path + where) && Catch::Contains(what));
  };
  refuses("", "", "holds no pass mark");
  refuses("target_reached = false\n", "", "holds no pass mark");
  refuses("target_reached = 1\n", ":1: target_reached", "true or false");
  refuses("[at_most]\nlargest_force_N = 3\n", ":2: at_most.largest_force_N", "largest_force_mN");
  refuses("[at_most]\nlargest_force_mN = -3\n", ":2: at_most.largest_force_mN", "from 0 to");
  refuses("[at_most]\nlargest_force_mN = \"3\"\n", ":2: at_most.largest_force_mN", "number");
  refuses("[at_most]\ncontrast_mL = 30\n", ":2: at_most.contrast_mL", "[effects.contrast]");
  refuses("[at_most\n", ":", "");
  CHECK_THROWS_AS(ReadMarks(folder.Path("none.toml"), MarkedReport(1, 1, 0)), UserError);
}

TEST_CASE("Report, page and summary have the verdict on each pass mark") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("marks.toml");
  WriteMarks(path, kMarksOfTrainer);
  SessionReport report = MarkedReport(41, 450, 0);
  report.marks = Compared(path, report);
  CHECK_THAT(FormatReport(report),
             Catch::Contains("pass marks   failed, by " + path) &&
                 Catch::Contains("Largest force on the wall: 450 mN; at most 300 mN: failed"));
  const auto json = nlohmann::json::parse(FormatReportJson(report, "", ""));
  CHECK(json["passed"] == false);
  CHECK(json["marks"][2] ==
        nlohmann::json(
            {{"name", "largest_force_mN"}, {"at_most", 300}, {"value", 450}, {"passed", false}}));
  CHECK(json["marks"][0]["at_most"].is_null());
  CHECK_THAT(FormatPage(report, {}),
             Catch::Contains("<td>Largest force on the wall</td><td class=\"number\">450 mN</td>"
                             "<td>at most 300 mN</td><td>&#x2717; failed</td>"));

  WriteMarks(folder.Path("a.session.json"), FormatSummary(Summarize(report)));
  const SessionSummary read = ReadSummary(folder.Path("a.session.json"));
  CHECK(read == Summarize(report));
  CHECK(read.passed == false);
  REQUIRE(read.marks.size() == 4);
  CHECK(read.marks[2].value == 450);
  CHECK(read.marks[3].passed == true);
}

TEST_CASE("A mark whose value is not known is null in JSON and summary, and no verdict in text") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("marks.toml");
  WriteMarks(path, kMarksOfTrainer);
  SessionReport report = MarkedReport(41, kUnknown, 0);
  report.marks = Compared(path, report);
  const nlohmann::json null;
  const auto json = nlohmann::json::parse(FormatReportJson(report, "", ""));
  CHECK(json.at("passed") == null);
  CHECK(json["marks"][2] ==
        nlohmann::json(
            {{"name", "largest_force_mN"}, {"at_most", 300}, {"value", null}, {"passed", null}}));
  CHECK(json["marks"][3].at("passed") == true);
  CHECK_THAT(
      FormatReport(report),
      Catch::Contains("pass marks   not known, by ") &&
          Catch::Contains("Largest force on the wall: not known; at most 300 mN: not known\n"));
  CHECK_THAT(FormatPage(report, {}),
             Catch::Contains("<td>Largest force on the wall</td><td class=\"number\">not known</td>"
                             "<td>at most 300 mN</td><td>not known</td>"));

  const auto summary = nlohmann::json::parse(FormatSummary(Summarize(report)));
  CHECK(summary.at("passed") == null);
  CHECK(summary["marks"][2] ==
        nlohmann::json({{"name", "largest_force_mN"}, {"value", null}, {"passed", null}}));
  WriteMarks(folder.Path("a.session.json"), summary.dump());
  const SessionSummary read = ReadSummary(folder.Path("a.session.json"));
  CHECK_FALSE(read.passed);
  CHECK_FALSE(read.marks.at(2).value);
  CHECK_FALSE(read.marks[2].passed);
  CHECK(read.marks[3].passed == true);
}

TEST_CASE("Pass marks that are shipped belong to a scene, which measures them") {
  CHECK(PassMarksPath("host/scenes/neuro_arch.toml") == "host/scenes/pass_marks/neuro_arch.toml");
  int files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(SourcePath("/host/scenes/pass_marks"))) {
    INFO(entry.path());
    const std::string scene_file = SourcePath("/host/scenes/") + entry.path().filename().string();
    REQUIRE(std::filesystem::exists(scene_file));
    SessionReport report;
    for (const auto& effect : scene::ReadScene(scene_file).effects) {
      report.description.effects.push_back(effect.name);
    }
    CHECK(ReadMarks(PassMarksPath(scene_file), report).marks.size() > 2);
    ++files;
  }
  CHECK(files > 0);
}
