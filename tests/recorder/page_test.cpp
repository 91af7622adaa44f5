#include <sys/wait.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <regex>

#include "calibration/calibration_file.h"
#include "host/recorder/page_text.h"
#include "host/recorder/panel_plot.h"
#include "host/recorder/report_output.h"
#include "host/recorder/report_page.h"
#include "host/simulator/scene/scene_spec.h"
#include "tests/recorder/page_fixture.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

namespace {

// Matches a table row that begins with these cells.
auto Row(const std::string& name, const std::string& value) {
  return Catch::Contains("<td>" + name + "</td><td class=\"number\">" + value + "</td>");
}

int Count(const std::string& text, const std::string& part) {
  int count = 0;
  for (std::size_t at = 0; (at = text.find(part, at)) != std::string::npos; ++at) ++count;
  return count;
}

}  // namespace

TEST_CASE("The page shows the assessment with its limits") {
  const std::string page = FormatPage(PageReport(true), PagePartsOfCourse());
  CHECK(IsXml(page));
  CHECK_THAT(page, Catch::Contains("Target reached safely") &&
                       Catch::Contains("reached the target after 0:00.7 min") &&
                       Catch::Contains("The largest force on the wall was 80.0 mN, within the "
                                       "limit of 100 mN.") &&
                       Catch::Contains("Began 2023-11-14 22:13 UTC, recorded for 0:01.0 min"));
  CHECK_THAT(page, Row("Target: 95 mm along lad", "reached after 0:00.7 min") &&
                       Catch::Contains("tip within 3 mm of it"));
  CHECK_THAT(
      page,
      Row("Largest force on the wall, on any 2 mm of the instrument", "80.0 mN, at 0:00.5 min") &&
          Catch::Contains("<td>100 mN</td>") && Catch::Contains("&#x2713; within the limit"));
  CHECK_THAT(page,
             Row("Force above the scene's threshold of 30 mN", "3 times, 0:00.4 min in total"));
  CHECK_THAT(page, Row("Largest pressure of the tip's end, along the wire", "12.2 kPa"));
  CHECK_THAT(page, Row("Wrong vessels entered", "once"));
  CHECK_THAT(page, Row("Retractions of 2 mm or more", "2 times, 7.50 mm in total"));
  CHECK_THAT(page, Row("Fluoroscopy time", "0:00.3 min") && Row("Contrast agent", "1.50 mL"));
  CHECK_THAT(page, Row("Kerma-area product", "0.875 Gy cm&#xb2;"));
  CHECK_THAT(page,
             Row("Path length of the tip", "36.0 mm") && Row("Reversals, guidewire", "never"));
  CHECK_THAT(page, Row("Smoothness of the hand", "LDLJ -9.50 (no unit)") &&
                       Catch::Contains("Balasubramanian"));
  CHECK_THAT(page, Row("Simulated", "1000 ticks") &&
                       Row("Not in equilibrium at the end of a tick", "10 ticks (1.00 %)") &&
                       Row("Largest penetration of the wall", "12.5 &#xb5;m") &&
                       Row("Largest residual in equilibrium", "3.00e-07 (no unit)"));
  CHECK_THAT(page, Row("guidewire: reports of the device lost", "0 reports"));
  CHECK(page.find("<b>Note:</b>") == std::string::npos);
  CHECK_THAT(page, Catch::Contains("None was found beside this report. The learning curve"));
  CHECK(page.find("nan") == std::string::npos);
}

TEST_CASE("The page compares the contrast agent with the patient's limit") {
  const auto page = [](double limit_mL) {
    SessionReport report = PageReport(true);
    report.readings.names.emplace_back("contrast_limit_mL");
    report.readings.values.push_back(limit_mL);
    return FormatPage(report, PagePartsOfCourse());
  };
  CHECK_THAT(page(1.5), Row("Contrast agent", "1.50 mL, within the patient's limit of 1.50 mL"));
  CHECK_THAT(page(1.25), Row("Contrast agent", "1.50 mL, above the patient's limit of 1.25 mL"));
}

TEST_CASE("Page and JSON list the injections by the power injector") {
  SessionReport report = PageReport(true);
  CHECK_THAT(FormatPage(report, PagePartsOfCourse()), !Catch::Contains("Power injection"));
  torquer_lcm::readings_t readings{};
  readings.names = {"injection_start_s", "injection_set_mL", "injection_rate_mL_s", "injection_mL",
                    "injection_aborted"};
  for (const auto& values : std::vector<std::vector<double>>{
           {12.5, 8, 4, 8, 0}, {65, 8, 4, 3.25, 1}, {70, 6, 2, 1.5, 0}}) {
    readings.values = values;
    report.course.Add(readings);
  }
  const std::string page = FormatPage(report, PagePartsOfCourse());
  CHECK_THAT(page, Row("Power injection 1", "8.00 mL at 4.00 mL/s, from 0:12.5 min"));
  CHECK_THAT(page, Row("Power injection 2",
                       "aborted after 3.25 mL of 8.00 mL at 4.00 mL/s, from 1:05.0 min"));
  CHECK_THAT(page, Row("Power injection 3",
                       "unfinished, 1.50 mL of 6.00 mL at 2.00 mL/s, from 1:10.0 min"));
  const auto json = nlohmann::json::parse(FormatReportJson(report, "", ""))["injections"];
  CHECK(json.size() == 3);
  CHECK(json[1] == nlohmann::json::parse(R"({"start_s": 65.0, "volume_mL": 8.0, "rate_mL_s": 4.0,
    "delivered_mL": 3.25, "complete": false, "aborted": true})"));
  CHECK(json[0]["complete"] == true);
}

TEST_CASE("Page, text and JSON list the exchanges of instruments") {
  SessionReport report = PageReport(true);
  report.exchanges = {{12.5, "guidewire", "sion"}, {65, "guide<r>", "guiding_6f"}};
  const std::string page = FormatPage(report, PagePartsOfCourse());
  CHECK_THAT(page, Row("Exchange 1, at 0:12.5 min", "guidewire for sion"));
  CHECK_THAT(page, Row("Exchange 2, at 1:05.0 min", "guide&lt;r&gt; for guiding_6f"));
  CHECK_THAT(FormatReport(report), Catch::Contains("  exchange     guidewire for sion, at 0:12.5"));
  CHECK(nlohmann::json::parse(FormatReportJson(report, "", ""))["exchanges"] ==
        nlohmann::json::parse(R"([{"time_s": 12.5, "instrument": "guidewire", "device": "sion"},
          {"time_s": 65.0, "instrument": "guide<r>", "device": "guiding_6f"}])"));
}

TEST_CASE("The verdict follows the readings") {
  SessionReport report = PageReport(true);
  const PageParts parts = PagePartsOfCourse();
  SetReading(report, "wall_force_largest_ever_mN", 130);
  SetReading(report, "safe_success", 0);
  std::string page = FormatPage(report, parts);
  CHECK_THAT(page, Catch::Contains("Target reached, but not safely") &&
                       Catch::Contains("130 mN, above the limit of 100 mN") &&
                       Catch::Contains("&#x2717; above the limit") &&
                       Catch::Contains("class=\"verdict poor\""));
  SetReading(report, "target_reached", 0);
  SetReading(report, "target_reached_s", std::numeric_limits<double>::quiet_NaN());
  page = FormatPage(report, parts);
  CHECK_THAT(page, Catch::Contains("Target not reached") &&
                       Catch::Contains("did not reach the target in 0:01.0 min") &&
                       Row("Target: 95 mm along lad", "not reached"));
  CHECK_THAT(page, !Catch::Contains("dashed: target reached"));
}

TEST_CASE("The figures of a scene with outlets show an instrument that left the model") {
  SessionReport report = PageReport(true);
  const std::string title = "Left the model at an outlet, and was held there";
  CHECK_THAT(FormatPage(report, PagePartsOfCourse()), !Catch::Contains(title));
  report.readings.names.emplace_back("left_model_events");
  report.readings.values.push_back(2);
  report.readings.count = static_cast<std::int32_t>(report.readings.names.size());
  report.solver.ticks = 40;
  report.solver.left_model = 10;
  CHECK_THAT(FormatPage(report, PagePartsOfCourse()), Row(title, "2 times, 10 ticks (25.0 %)"));
}

TEST_CASE("An unknown result is shown as unknown, never as 0") {
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  SessionReport report = PageReport(true);
  const TemporaryFolder folder;
  SetReading(report, "safe_success", unknown);
  std::string page = FormatPage(report, PagePartsOfCourse());
  CHECK_THAT(page, Catch::Contains("Target reached; safety not known") &&
                       Catch::Contains("class=\"verdict open\"") && !Catch::Contains("not safely"));
  SetReading(report, "target_reached_s", unknown);
  page = FormatPage(report, PagePartsOfCourse());
  CHECK_THAT(page, Catch::Contains("reached the target; the time is not known.") &&
                       Row("Target: 95 mm along lad", "reached; time not known"));
  for (const char* name : {"wall_force_largest_ever_mN", "wall_force_events", "wall_force_above_s",
                           "wall_tip_pressure_ever_kPa", "tip_path_mm", "wrong_vessel_entries",
                           "target_reached", "target_reached_s"}) {
    SetReading(report, name, unknown);
  }
  page = FormatPage(report, PagePartsOfCourse());
  CHECK(IsXml(page));
  CHECK_THAT(page, Catch::Contains("<strong>Not known</strong>"));
  CHECK_THAT(page,
             Row("Target: 95 mm along lad", "not known") &&
                 Row("Path length of the tip", "not known") &&
                 Row("Largest force on the wall, on any 2 mm of the instrument", "not known"));
  CHECK_THAT(page, !Catch::Contains("nan") && !Catch::Contains("within the limit"));
  const SessionSummary summary = Summarize(report);
  CHECK_FALSE(summary.target_reached);
  CHECK_FALSE(summary.wall_force_mN);
  CHECK_FALSE(summary.tip_path_mm);
  std::ofstream(folder.Path("unknown.session.json")) << FormatSummary(summary);
  CHECK(ReadSummary(folder.Path("unknown.session.json")) == summary);
  CHECK_THAT(FormatReport(report), Catch::Contains("wall_force_largest_ever_mN not known\n"));
  const auto json = nlohmann::json::parse(FormatReportJson(report, "", ""));
  CHECK(json["readings"]["wall_force_largest_ever_mN"].is_null());
}

TEST_CASE("A scene without assessment has a page without a judgment") {
  const std::string page = FormatPage(PageReport(false), PageParts());
  CHECK(IsXml(page));
  CHECK_THAT(page, Catch::Contains("Not assessed") && Catch::Contains("no X-ray in this scene") &&
                       Row("Contrast agent", "none in this scene") &&
                       Row("Path length of the tip", "35.9 mm"));
  CHECK_THAT(page, !Catch::Contains("X-ray and contrast"));
}

TEST_CASE("The page names the causes of doubtful figures") {
  SessionReport report = PageReport(true);
  PageParts parts = PagePartsOfCourse();
  parts.scene_changed = true;
  report.instruments[0].axial.error_counts = 7;
  report.undecodable = 3;
  report.damage.places = 2;
  report.damage.bytes = 91;
  report.ended = false;
  std::string page = FormatPage(report, parts);
  CHECK_THAT(page, Catch::Contains("did not follow its hand: they are 7.00 counts") &&
                       Catch::Contains("3 messages of the recording cannot be read") &&
                       Catch::Contains("damaged: 2 damaged places") &&
                       Catch::Contains("ends before the session") &&
                       Catch::Contains("scene file has changed"));
  report.instruments[0].reports_lost = 4;
  CHECK_THAT(FormatPage(report, parts), Catch::Contains("lost 4 reports"));
}

TEST_CASE("An error by the segments beyond the target's radius puts the result in doubt") {
  SessionReport report = PageReport(true);
  PageParts parts = PagePartsOfCourse();
  REQUIRE(parts.limits.target_radius_mm);
  const auto note = Catch::Contains("With shorter segments the wire may lie up to ");
  const std::string row = "Largest error by the segments, an estimate";
  CHECK_THAT(FormatPage(report, parts), !note && !Catch::Contains(row));
  report.description.effects.emplace_back("segment_error");
  report.readings.names.emplace_back("segment_error_largest_ever_mm");
  report.readings.values.push_back(0.9 * *parts.limits.target_radius_mm);
  CHECK_THAT(FormatPage(report, parts), !note);
  report.readings.values.back() = 4.25;
  CHECK_THAT(FormatPage(report, parts),
             Catch::Contains("may lie up to 4.25 mm elsewhere") && Row(row, "4.25 mm"));
  report.readings.values.back() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THAT(FormatPage(report, parts), !note && Row(row, "not known"));
}

TEST_CASE("Every figure in the tables has a unit") {
  SessionReport report = PageReport(true);
  PageParts parts = PagePartsOfCourse();
  parts.earlier.sessions = {Summarize(report)};
  const std::string page = FormatPage(report, parts);
  // Nouns that are counted are units too.
  const std::regex unit(
      "mN|kPa|mm|mL|mGy|Gy "
      "cm|deg|%|\\bs\\b|\\bmin\\b|&#xb5;[ms]|\\bms\\b|ticks|times|reports|counts|"
      "pulses|"
      "no unit|UTC");
  const std::regex cell("<td[^>]*>([^<]*)</td>");
  int figures = 0;
  for (std::sregex_iterator at(page.begin(), page.end(), cell), end; at != end; ++at) {
    const std::string text = std::regex_replace((*at)[1].str(), std::regex("&#x2[0-9a-f]+;"), "");
    if (!std::regex_search(text, std::regex("[0-9]")) || text == "1" || text == "2") continue;
    ++figures;
    INFO(text);
    CHECK(std::regex_search(text, unit));
  }
  CHECK(figures > 25);
}

TEST_CASE("The page has all that it shows, and text of a log is text") {
  SessionReport report = PageReport(true);
  PageParts parts = PagePartsOfCourse();
  const std::string hostile = "\"><script>alert(1)</script>&'\x1b\x01\xff]]>";
  report.scene = report.method = hostile;
  report.description.vessel = hostile;
  report.instruments[0].name = report.instruments[0].device = hostile;
  report.last_state.instruments[0].name = hostile;
  parts.log = "/folder/" + hostile;
  parts.limits.target_centerline = hostile;
  parts.earlier.refused = {hostile};
  SessionCourse course;
  for (int i = 0; i < 3; ++i) {
    torquer_lcm::wire_state_t state = report.last_state;
    state.instruments.push_back(state.instruments[0]);
    state.tick = i;
    state.time_s = i;
    course.Add(state);
  }
  report.course = course;
  parts.picture = DrawReport(report, {}, true);
  const std::string page = FormatPage(report, parts);
  CHECK(IsXml(page));
  CHECK(Count(page, "<script") == 0);
  CHECK(Count(page, "&lt;script&gt;") >= 9);
  // The page makes no request: all of its links point into the page itself.
  CHECK(Count(page, "http") == Count(page, "xmlns=\"http://www.w3.org/") + 1);  // http-equiv
  CHECK(Count(page, "src=") == 0);
  CHECK(Count(page, "href=") == Count(page, "href=\"#"));
  CHECK(Count(page, "url(") == Count(page, "url(#"));
  CHECK(Count(page, "@import") == 0);
  CHECK_THAT(page, Catch::Contains("default-src 'none'"));
}

TEST_CASE("A page of several instruments names the instrument of its tip") {
  SessionReport report = PageReport(true);
  const std::string whose = "are those of guidewire, the innermost instrument";
  CHECK(FormatPage(report, PagePartsOfCourse()).find(whose) == std::string::npos);
  torquer_lcm::wire_state_t state = report.last_state;
  state.instruments.push_back(state.instruments[0]);
  report.course.Add(state);
  CHECK_THAT(FormatPage(report, PagePartsOfCourse()), Catch::Contains(whose));
}

TEST_CASE("Earlier sessions make a learning curve, and damaged ones are named") {
  const SessionReport report = PageReport(true);
  PageParts parts = PagePartsOfCourse();
  SessionSummary first = Summarize(report);
  *first.started_us -= 3'600'000'000;
  first.target_reached = false;
  first.target_s.reset();
  first.wall_force_mN = 222.5;
  SessionSummary second = Summarize(report);
  *second.started_us -= 1'800'000'000;
  second.safe = false;
  second.contrast_mL.reset();
  parts.earlier.sessions = {first, second};
  parts.earlier.refused = {"old.session.json: is damaged"};
  const std::string page = FormatPage(report, parts);
  CHECK(IsXml(page));
  CHECK_THAT(page, Catch::Contains("<td>1</td><td>2023-11-14 21:13 UTC</td><td>&#x2717; not "
                                   "reached</td>") &&
                       Catch::Contains("<td>2</td><td>2023-11-14 21:43 UTC</td><td>&#x2717; "
                                       "unsafe</td>") &&
                       Catch::Contains("<td>3</td><td>2023-11-14 22:13 UTC</td><td>&#x2713; "
                                       "safe</td>"));
  CHECK_THAT(page, Catch::Contains("<td>222 mN</td>") && Catch::Contains("&#x2013;"));
  CHECK_THAT(page, Catch::Contains("<b>Left out:</b> old.session.json: is damaged"));
  // Three sessions in each panel, except the target's, which two sessions reached.
  CHECK(Count(page, "<circle") == 2 + 3 + 3 + 3);
}

TEST_CASE("Numbers have three significant digits, and times are minutes and seconds") {
  CHECK(ValueText(0) == "0");
  CHECK(ValueText(3.14159e-7) == "3.14e-07");
  CHECK(ValueText(-0.5) == "-0.500");
  CHECK(ValueText(41.25) == "41.2");
  CHECK(ValueText(99.96) == "100");
  CHECK(ValueText(12345.6) == "12346");
  CHECK(SecondsText(0) == "0:00.0 min");
  CHECK(SecondsText(59.96) == "1:00.0 min");
  CHECK(SecondsText(61.24) == "1:01.2 min");
  CHECK(SecondsText(605.4) == "10:05 min");
}

TEST_CASE("Panels lie where their values are") {
  PlotPanel panel{.title = "a <b> (mm)", .curves = {{"", {{0, 0}, {10, 4}}}}, .from_zero = true};
  PlotPanel bars{.title = "c", .bars = {{"on", {{2, 4}}}}};
  const PlotAxis axis{.label = "Time (s)", .begin = 0, .end = 10, .mark = 5.0, .mark_label = "m"};
  std::string svg = DrawPanels("name & co", {panel, bars}, axis);
  CHECK(IsXml(svg));
  CHECK_THAT(svg, Catch::Contains(">a &lt;b&gt; (mm)<") && Catch::Contains("name &amp; co"));
  // 10 s span the pixels from 66 to 944: 2 s are 175.6 pixels, the mark is at 505.
  CHECK_THAT(svg, Catch::Contains("x=\"241.6\""));
  CHECK_THAT(svg, Catch::Contains("width=\"175.6\" height=\"13.0\""));
  CHECK(Count(svg, "M505.0 ") >= 2);
  // 0 to 4.28 mm span 84 pixels from 28 on.
  CHECK_THAT(svg, Catch::Contains("d=\"M66.0 112.0L944.0 33.5\""));
  // A limit is drawn only if it leaves room for the values, but always named.
  panel.limit = {5, "limit 5 mm"};
  svg = DrawPanels("", {panel}, axis);
  CHECK(Count(svg, "stroke-dasharray=\"10 3\"") == 2);
  panel.limit = {500, "limit 500 mm"};
  svg = DrawPanels("", {panel}, axis);
  CHECK(Count(svg, "stroke-dasharray=\"10 3\"") == 1);
  CHECK_THAT(svg, Catch::Contains("limit 500 mm"));
  // Points that do not count are dots; beyond the scale they lie on its edge.
  panel.limit.reset();
  panel.uncounted = {{5, 2}, {10, 12000}};
  panel.uncounted_label = "gray: does not count";
  svg = DrawPanels("", {panel}, axis);
  CHECK(IsXml(svg));
  CHECK_THAT(svg, Catch::Contains("d=\"M66.0 112.0L944.0 33.5\""));
  CHECK_THAT(svg, Catch::Contains("d=\"M505.0 72.7h0M944.0 28.0h0\""));
  CHECK_THAT(svg, Catch::Contains(">gray: does not count<"));
  // Drawing must terminate for any values.
  panel.curves[0].points = {{1e12, 1e12}, {1e12, 1e12 + 1e-4}};
  CHECK(DrawPanels("", {panel}, {.label = "", .begin = 1e12, .end = 1e12}).find("nan") ==
        std::string::npos);
  CHECK_FALSE(DrawPanels("", {}, {.label = "", .begin = 1, .end = 0}).empty());
}

TEST_CASE("Limits are those of the scene, its defaults included") {
  const SessionLimits limits =
      ReadLimits(scene::ReadScene(SourcePath("/host/scenes/everything.toml")));
  CHECK(limits.target_centerline == "lad");
  CHECK(limits.target_at_mm == 95);
  CHECK(limits.target_radius_mm == 3);  // a default
  CHECK(limits.force_limit_mN == 100);
  CHECK(limits.patch_mm == 2);  // a default
  CHECK(limits.threshold_mN == 30);
  const SessionLimits none =
      ReadLimits(scene::ReadScene(SourcePath("/host/scenes/drill_tube.toml")));
  CHECK(none.target_centerline.empty());
  CHECK_FALSE(none.force_limit_mN);
}

TEST_CASE("torquer-report writes the page and the summary, and refuses invalid paths") {
  const TemporaryFolder folder;
  calibration::Calibration calibration = calibration::NominalCalibration("made-up", 1200);
  calibration.motion.per_count = {{{kMmPerCount, 0.0}, {0.0, kRadPerCount}}};
  calibration::WriteCalibration(calibration, folder.Path("calibration.toml"));
  const auto run = [&folder](const std::string& arguments) {
    const std::string command = ProgramPath("torquer-report") + " " + folder.Path("log") +
                                " --calibration " + folder.Path("calibration.toml") + " --scene " +
                                SourcePath("/host/scenes/drill_tube.toml") + " " + arguments +
                                " >" + folder.Path("out") + " 2>" + folder.Path("err");
    return WEXITSTATUS(std::system(command.c_str()));
  };
  SessionFaults faults;
  faults.course = true;
  WriteSession(folder.Path("log"), faults);
  std::ofstream(folder.Path("old.session.json")) << "{";
  REQUIRE(run("--json --page " + folder.Path("report.html")) == 0);
  CHECK(nlohmann::json::parse(Contents(folder.Path("out"))).at("page") ==
        folder.Path("report.html"));
  const std::string page = Contents(folder.Path("report.html"));
  CHECK(IsXml(page));
  CHECK_THAT(page, Catch::Contains("<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"session\"") &&
                       Catch::Contains("The scene file has changed") &&
                       Catch::Contains("old.session.json: is not a summary of a session"));
  const SessionSummary summary = ReadSummary(folder.Path("report.session.json"));
  CHECK(summary.scene == "made_up");
  CHECK(summary.target_s == 0.7);
  CHECK(summary.wall_force_mN == 80);

  CHECK(run("--page " + folder.Path("log")) == 2);
  CHECK_THAT(Contents(folder.Path("err")), Catch::Contains("ends in .html"));
  CHECK(run("--page " + folder.Path("none/report.html")) == 2);
  CHECK_THAT(Contents(folder.Path("err")), Catch::Contains("none/report.html"));
  std::filesystem::remove(folder.Path("report.html"));
  std::filesystem::remove(folder.Path("log"));
  CHECK(run("--page " + folder.Path("report.html")) == 2);
  CHECK_FALSE(std::filesystem::exists(folder.Path("report.html")));
}
