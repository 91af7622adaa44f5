#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "host/recorder/report_output.h"
#include "host/recorder/session_judge.h"
#include "host/recorder/session_summary.h"
#include "host/support/error.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

namespace {

SessionSummary Made(std::int64_t started_us) {
  SessionSummary summary;
  summary.scene = "made <up>";
  summary.started_us = started_us;
  summary.procedure_s = 62.5;
  summary.target_reached = true;
  summary.safe = false;
  summary.target_s = 41.25;
  summary.wall_force_mN = 123.5;
  summary.tip_path_mm = 300;
  summary.reversals = 4;
  summary.trainee = "Ann \"A\" Smith";
  summary.group = "2026";
  summary.air_kerma_mGy = 12.5;
  summary.air_kerma_mGy_min = 9.25;
  summary.blind_mm = 31.5;
  summary.blind_s = 4.5;
  summary.retractions = 2;
  summary.retracted_mm = 7.5;
  summary.before_motion_s = 3.5;
  summary.on_the_way_s = 37.75;
  summary.after_target_s = 21.25;
  return summary;
}

void WriteFile(const std::string& path, const std::string& text) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  std::ofstream(path) << text;
}

std::vector<std::int64_t> Starts(const EarlierSessions& earlier) {
  std::vector<std::int64_t> starts;
  for (const SessionSummary& summary : earlier.sessions) {
    starts.push_back(summary.started_us.value_or(-1));
  }
  return starts;
}

}  // namespace

TEST_CASE("A written summary is read unchanged") {
  const TemporaryFolder folder;
  const SessionSummary summary = Made(1'700'000'000'000'000);
  WriteFile(folder.Path("a.session.json"), FormatSummary(summary));
  CHECK(ReadSummary(folder.Path("a.session.json")) == summary);
  CHECK(FormatSummary(summary).size() < EarlierSessions::kMostBytes / 10);
  CHECK(SummaryPath("/x.y/report.html") == "/x.y/report.session.json");
  CHECK(SummaryPath("report.html") == "report.session.json");
}

TEST_CASE("A summary of an earlier release is read without its later figures") {
  const TemporaryFolder folder;
  SessionSummary summary = Made(5);
  nlohmann::json json = nlohmann::json::parse(FormatSummary(summary));
  for (const char* name :
       {"trainee", "group", "air_kerma_mGy", "air_kerma_mGy_min", "blind_mm", "blind_s",
        "retractions", "retracted_mm", "before_motion_s", "on_the_way_s", "after_target_s"}) {
    CHECK(json.erase(name) == 1);
  }
  WriteFile(folder.Path("a.session.json"), json.dump());
  summary.trainee = summary.group = "";
  summary.air_kerma_mGy = summary.air_kerma_mGy_min = summary.blind_mm = summary.blind_s =
      summary.retractions = summary.retracted_mm = std::nullopt;
  summary.before_motion_s = summary.on_the_way_s = summary.after_target_s = std::nullopt;
  CHECK(ReadSummary(folder.Path("a.session.json")) == summary);
}

TEST_CASE("A damaged summary is refused with the reason") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("a.session.json");
  const auto refuses = [&](const std::string& text, const std::string& what) {
    WriteFile(path, text);
    CHECK_THROWS_WITH(ReadSummary(path), Catch::StartsWith(path) && Catch::Contains(what));
    CHECK_THROWS_AS(ReadSummary(path), UserError);
  };
  const auto with = [](const std::string& name, const nlohmann::json& value) {
    nlohmann::json json = nlohmann::json::parse(FormatSummary(Made(5)));
    json[name] = value;
    return json.dump();
  };
  refuses("", "no JSON object");
  refuses("[1]", "no JSON object");
  refuses(FormatSummary(Made(5)).substr(0, 60), "no JSON object");
  refuses("{}", "session_summary is missing");
  refuses(with("session_summary", 3), "another version");
  refuses(with("scene", 3), "scene is not a text");
  refuses(with("started_us", -1), "started_us is not a count");
  refuses(with("procedure_s", nullptr), "procedure_s is missing");
  refuses(with("procedure_s", "1"), "procedure_s is not a number");
  refuses(with("wall_force_mN", -2), "wall_force_mN is out of range");
  refuses(with("tip_path_mm", 1e200), "tip_path_mm is out of range");
  refuses(with("blind_mm", -1), "blind_mm is out of range");
  refuses(with("trainee", 1), "trainee is not a text");
  refuses(with("safe", 1), "safe is neither true nor false");
  refuses(with("scene", std::string(EarlierSessions::kMostBytes, 'x')), "bytes");
}

TEST_CASE("A session without a known start has null, and earlier files have 0 for it") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("a.session.json");
  SessionReport report;
  report.started_us = 0;
  nlohmann::json json = nlohmann::json::parse(FormatSummary(Summarize(report)));
  CHECK(json.at("started_us").is_null());
  SessionSummary summary = Made(5);
  summary.started_us.reset();
  WriteFile(path, FormatSummary(summary));
  CHECK(ReadSummary(path) == summary);
  json = nlohmann::json::parse(FormatSummary(summary));
  json["started_us"] = 0;
  WriteFile(path, json.dump());
  CHECK(ReadSummary(path) == summary);
}

TEST_CASE("Earlier sessions of the scene are found beside the page and beside its folder") {
  const TemporaryFolder folder;
  const std::string page = folder.Path("now/report.html");
  const SessionSummary now = Made(1000);
  WriteFile(folder.Path("now/report.session.json"), FormatSummary(now));
  WriteFile(folder.Path("now/copy.session.json"), FormatSummary(now));
  WriteFile(folder.Path("now/other.session.json"), FormatSummary(Made(300)));
  WriteFile(folder.Path("now/later.session.json"), FormatSummary(Made(1001)));
  WriteFile(folder.Path("now/record.json"), "no summary");
  WriteFile(folder.Path("first/report.session.json"), FormatSummary(Made(100)));
  WriteFile(folder.Path("first/unnamed.session.json"), FormatSummary(Made(150)));
  WriteFile(folder.Path("second/report.session.json"), FormatSummary(Made(200)));
  SessionSummary foreign = Made(250);
  foreign.scene = "another";
  WriteFile(folder.Path("third/report.session.json"), FormatSummary(foreign));
  SessionSummary of_another = Made(260);
  of_another.trainee = "Bob";
  WriteFile(folder.Path("fourth/report.session.json"), FormatSummary(of_another));
  WriteFile(folder.Path("damaged/report.session.json"), "{");
  std::filesystem::create_symlink("first", folder.Path("latest"));
  std::filesystem::create_directories(folder.Path("now/folder.session.json"));

  const EarlierSessions earlier = ReadEarlierSessions(page, now);
  CHECK(Starts(earlier) == std::vector<std::int64_t>{100, 200, 300});
  REQUIRE(earlier.refused.size() == 2);
  CHECK_THAT(earlier.refused[0], Catch::Contains("now/folder.session.json"));
  CHECK_THAT(earlier.refused[1], Catch::Contains("damaged/report.session.json"));
  CHECK(ReadEarlierSessions(folder.Path("none/none/report.html"), now).sessions.empty());
}

TEST_CASE(
    "Of many earlier sessions the newest are taken, and of many damaged ones some are named") {
  const TemporaryFolder folder;
  constexpr int kSessions = 40;
  for (int i = 1; i <= kSessions; ++i) {
    WriteFile(folder.Path("a" + std::to_string(i) + ".session.json"), FormatSummary(Made(i)));
    WriteFile(folder.Path("b" + std::to_string(i) + ".session.json"), "{");
  }
  const EarlierSessions earlier = ReadEarlierSessions(folder.Path("report.html"), Made(1000));
  REQUIRE(earlier.sessions.size() == EarlierSessions::kMost);
  CHECK(earlier.sessions.front().started_us == kSessions - EarlierSessions::kMost + 1);
  CHECK(earlier.sessions.back().started_us == kSessions);
  CHECK(earlier.refused.size() == EarlierSessions::kMostRefused);
}

TEST_CASE("A report has the marks of the replay, or none with the reason") {
  torquer::SessionReport report;
  report.readings.names = {"target_reached", "safe_success", "wall_force_largest_ever_mN"};
  report.readings.values = {1, 1, 12};
  torquer::SessionJudgment judgment;
  judgment.readings.names = report.readings.names;
  judgment.readings.values = {1, 0, 700};
  torquer::SessionReport judged = report;
  ApplyJudgment(judgment, judged);
  CHECK(judged.judged);
  CHECK(torquer::Summarize(judged).safe == false);
  CHECK(torquer::Summarize(judged).wall_force_mN == 700);
  CHECK_THAT(torquer::FormatReportJson(judged, "", ""),
             Catch::Contains("\"judged\":true,\"not_gradable\":null"));

  ApplyJudgment({.not_gradable = "the recording is damaged", .course = {}}, report);
  const torquer::SessionSummary none = torquer::Summarize(report);
  CHECK_FALSE(none.gradable);
  CHECK_FALSE(none.target_reached.has_value());
  CHECK_FALSE(none.safe.has_value());
  CHECK_FALSE(none.wall_force_mN.has_value());
  CHECK_THAT(torquer::FormatReport(report),
             Catch::Contains("none, not gradable: the recording is damaged"));
  CHECK_THAT(torquer::FormatReportJson(report, "", ""),
             Catch::Contains("\"not_gradable\":\"the recording is damaged\""));
}
