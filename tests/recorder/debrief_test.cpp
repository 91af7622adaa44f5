// Figures for a debrief: phases, motion without X-ray, and an expert run beside the session.
#include <catch2/catch.hpp>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "host/recorder/pass_marks.h"
#include "host/recorder/report_output.h"
#include "host/recorder/report_page.h"
#include "host/recorder/session_summary.h"
#include "tests/recorder/page_fixture.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

TEST_CASE("The figures of an expert run stand beside those of the session") {
  SessionReport report = PageReport(true);
  const std::string alone = FormatPage(report, PagePartsOfCourse());
  CHECK_THAT(alone, !Catch::Contains("xpert"));
  ExpertRun expert{
      .file = "/scenes/experts/made_up.csv", .readings = report.readings, .course = report.course};
  report.expert = expert;
  SetReading(report, "wall_force_largest_ever_mN", 130);
  SetReading(report, "retractions", 9);
  const std::string page = FormatPage(report, PagePartsOfCourse());
  CHECK(IsXml(page));
  CHECK_THAT(page, Catch::Contains("<th>Expert run</th>") && Catch::Contains("made_up.csv"));
  CHECK_THAT(page, Catch::Contains("<td class=\"number\">130 mN, at 0:00.5 min</td><td "
                                   "class=\"number\">80.0 mN, at 0:00.5 min</td>"));
  CHECK_THAT(page, Catch::Contains("<td class=\"number\">9 times, 7.50 mm in total</td><td "
                                   "class=\"number\">2 times, 7.50 mm in total</td>"));
  CHECK_THAT(FormatReport(report), Catch::Contains("retractions 9; expert run 2\n"));
  const auto json = nlohmann::json::parse(FormatReportJson(report, "", ""));
  CHECK(json["expert"]["script"] == "/scenes/experts/made_up.csv");
  CHECK(json["expert"]["readings"]["retractions"] == 2);
  report.expert.reset();
  CHECK(nlohmann::json::parse(FormatReportJson(report, "", ""))["expert"].is_null());
}

TEST_CASE("Page, report and JSON have phases, motion without X-ray, dose rate and trainee") {
  SessionReport report = PageReport(true);
  report.readings.names.emplace_back("air_kerma_mGy");
  report.readings.values.push_back(12);
  report.trainee = "Ann <A>";
  report.group = "2026";
  const SessionSummary summary = Summarize(report);
  // It moves from the first report on, with the pedal up until report 200.
  CHECK(summary.before_motion_s.value() < 0.2);
  CHECK(summary.on_the_way_s.value() + summary.before_motion_s.value() == Approx(0.7));
  CHECK(summary.after_target_s.value() > 0);
  CHECK(summary.blind_mm.value() > 1);
  CHECK(summary.retractions == 2);
  CHECK(summary.air_kerma_mGy_min.value() == Approx(12 / *summary.fluoroscopy_s * 60));
  const std::string page = FormatPage(report, PagePartsOfCourse());
  CHECK_THAT(page, Catch::Contains("Trainee: Ann &lt;A&gt;, group 2026.") &&
                       Catch::Contains("<td>Moving without X-ray</td>") &&
                       Catch::Contains("<td>From there to the target</td>") &&
                       Catch::Contains("<td>Its mean rate with the pedal down</td>"));
  CHECK_THAT(FormatReport(report), Catch::Contains("  phases       before_motion_s 0:00.0 min\n") &&
                                       Catch::Contains(" mGy/min\n"));
  const auto json = nlohmann::json::parse(FormatReportJson(report, "", ""));
  CHECK(json["trainee"] == "Ann <A>");
  CHECK(json["phases"]["on_the_way_s"] == summary.on_the_way_s.value());
  CHECK(json["blind_mm"] == summary.blind_mm.value());
  report.not_gradable = "a reason";
  CHECK_FALSE(Summarize(report).blind_mm.has_value());
  CHECK_FALSE(Summarize(report).on_the_way_s.has_value());
}

TEST_CASE("The dose of a biplane system is the sum over its planes, and the page has both") {
  const TemporaryFolder folder;
  const std::string marks = folder.Path("marks.toml");
  std::ofstream(marks) << "[at_most]\nair_kerma_mGy = 14\n";
  SessionReport report = PageReport(true);
  report.description.effects.emplace_back("fluoroscopy");
  const auto add = [&report](const char* name, double value) {
    report.readings.names.emplace_back(name);
    report.readings.values.push_back(value);
  };
  const auto judged = [&] {
    MarkSheet sheet = ReadMarks(marks, report);
    CompareMarks(report, sheet);
    return sheet.Passed();
  };
  add("air_kerma_mGy", 12);
  CHECK(Summarize(report).air_kerma_mGy == 12);
  CHECK(judged() == true);
  CHECK_THAT(FormatPage(report, PagePartsOfCourse()), Catch::Contains(">12.0 mGy<"));
  add("lateral_air_kerma_mGy", 3);
  const SessionSummary both = Summarize(report);
  CHECK(both.air_kerma_mGy == 15);
  CHECK(both.air_kerma_mGy_min.value() == Approx(15 / *both.fluoroscopy_s * 60));
  CHECK(judged() == false);
  CHECK_THAT(FormatPage(report, PagePartsOfCourse()),
             Catch::Contains(">15.0 mGy: plane A 12.0, plane B 3.00<"));
  report.readings.values.back() = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(Summarize(report).air_kerma_mGy.has_value());
  CHECK_FALSE(judged().has_value());
}
