#include "host/study/study.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "host/api/row_run.h"
#include "host/api/script_columns.h"
#include "host/simulator/simulation.h"
#include "host/support/error.h"
#include "tests/study/study_program.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_folder.h"

namespace torquer::study {
namespace {

using test::ChildProcess;
using test::TemporaryFolder;

std::string ReadAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

std::size_t Count(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

StudyRun MakeRun(const TemporaryFolder& folder) {
  StudyRun::Options options;
  options.folder = folder.Path("results");
  return StudyRun("sample", options);
}

TEST_CASE("a row is a JSON object with five keys") {
  const auto json = nlohmann::json::parse(FormatJson({"paper", "n=250, \"odd\"", "ms", 0.1, "ms"}));
  CHECK(json.size() == 5);
  CHECK(json["study"] == "paper");
  CHECK(json["case"] == "n=250, \"odd\"");
  CHECK(json["metric"] == "ms");
  CHECK(json["value"] == 0.1);
  CHECK(json["unit"] == "ms");
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  CHECK(nlohmann::json::parse(FormatJson({"a", "b", "c", nothing, ""}))["value"].is_null());
}

TEST_CASE("a finished run leaves whole files") {
  const TemporaryFolder folder;
  StudyRun run = MakeRun(folder);
  run.Section("First <section>");
  run.Record("case, one", "time", 0.25, "s");
  run.Show({"A table", {"what", "value"}, {{"a & b", "1"}}});
  run.Draw({"A plot", {"x"}, {"y"}, {{"line", Mark::kLine, {0, 1}, {0, 1}}}}, "A caption.");
  run.ShowFirst({"The summary", {"what"}, {{"all"}}});
  run.Finish("A title");

  CHECK(ReadAll(folder.Path("results/sample.csv")) ==
        "study,case,metric,value,unit\nsample,\"case, one\",time,0.25,s\n");
  CHECK(nlohmann::json::parse(ReadAll(folder.Path("results/sample.jsonl")))["value"] == 0.25);
  const std::string html = ReadAll(folder.Path("results/sample.html"));
  CHECK(html.starts_with("<!doctype html>"));
  CHECK(html.ends_with("</html>\n"));
  CHECK(Count(html, "<svg ") == 1);
  CHECK(Count(html, "First &lt;section&gt;") == 1);
  CHECK(Count(html, "a &amp; b") == 1);
  const std::string svg = ReadAll(folder.Path("results/sample.svg"));
  CHECK(svg.starts_with("<svg "));
  CHECK(html.find(svg) != std::string::npos);
  CHECK(html.find("The summary") < html.find("First &lt;section&gt;"));
  for (const auto& entry : std::filesystem::directory_iterator(folder.Path("results"))) {
    CHECK(entry.path().extension() != ".unfinished");
  }
}

TEST_CASE("a file that cannot be replaced stays complete") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("taken");
  std::filesystem::create_directory(path);
  std::ofstream(folder.Path("taken/inside")) << "kept";
  CHECK_THROWS_AS(WriteWhole(path, "text"), UserError);
  CHECK(ReadAll(folder.Path("taken/inside")) == "kept");
  CHECK_FALSE(std::filesystem::exists(path + ".unfinished"));
  CHECK_THROWS_AS(WriteWhole(folder.Path("no/such/folder/file"), "text"), UserError);

  const std::string old = folder.Path("old");
  WriteWhole(old, "first");
  WriteWhole(old, "second");
  CHECK(ReadAll(old) == "second");
}

// Value of an attribute in the first element that contains `mark`.
double AttributeBefore(const std::string& svg, const std::string& mark, const std::string& name) {
  const std::size_t start = svg.rfind('<', svg.find(mark) - 1);
  return std::stod(svg.substr(svg.find(" " + name + "=\"", start) + name.size() + 3));
}

TEST_CASE("a label in a list stays in its own row") {
  Plot plot;
  plot.x = {"time, s", true, {}};
  plot.y.is_list = true;
  for (int row = 0; row < 25; ++row) {
    plot.callouts.push_back({1.0 + row % 3, -1.0 * row, "row " + std::to_string(row) + "."});
  }
  plot.series = {{"", Mark::kPoints, {}, {}}};
  for (const auto& callout : plot.callouts) {
    plot.series[0].x.push_back(callout.x);
    plot.series[0].y.push_back(callout.y);
  }
  const std::string svg = DrawPlot(plot);
  const double first = AttributeBefore(svg, ">row 0.</text>", "y");
  const double second = AttributeBefore(svg, ">row 1.</text>", "y");
  const double marker = AttributeBefore(svg, "r=\"8\"", "cy");
  CHECK(second > first);
  CHECK(std::abs(first - marker) < (second - first) / 2);
}

TEST_CASE("a plot shows every series and leaves out what its axes cannot show") {
  Plot plot;
  plot.x = {"time, s", true, {}};
  plot.y = {"error, mm", true, {}};
  plot.series = {{"points", Mark::kPoints, {0.01, 1, -1}, {1, 0.1, 1}, {"one", "two", "three"}},
                 {"bars", Mark::kBars, {0.1}, {0.5}},
                 {"line", Mark::kDashed, {0.01, 0.1, 1}, {1, 0, 0.1}}};
  plot.callouts = {{1, 0.1, "default"}};
  const std::string svg = DrawPlot(plot);
  CHECK(svg.starts_with("<svg "));
  CHECK(svg.ends_with("</svg>\n"));
  CHECK(Count(svg, "<title>one</title>") == 1);
  CHECK(Count(svg, "<title>three</title>") == 0);
  CHECK(Count(svg, ">line</text>") == 1);
  CHECK(Count(svg, ">default</text>") == 1);
  CHECK(Count(svg, "nan") == 0);
  CHECK(Count(svg, "inf") == 0);

  const std::string empty = DrawPlot({"Nothing", {"x"}, {"y"}, {}});
  CHECK(Count(empty, "nan") == 0);
}

TEST_CASE("the axes give the position of a point") {
  Plot plot;
  plot.width = 760;
  plot.x.range = {0, 10};
  plot.y.range = {0, 10};
  plot.series = {{"", Mark::kPoints, {5}, {5}}};
  const std::string svg = DrawPlot(plot);
  // Halfway along both axes, whose ends come from the plot's frame: M left top V bottom H right.
  double left = 0, top = 0, bottom = 0, right = 0, x = 0, y = 0;
  const std::size_t frame = svg.find("fill=\"none\" stroke=\"#9aa4b2\"");
  REQUIRE(frame != std::string::npos);
  const std::size_t path = svg.rfind("<path d=\"M", frame);
  REQUIRE(std::sscanf(svg.c_str() + path, "<path d=\"M%lf %lfV%lfH%lf", &left, &top, &bottom,
                      &right) == 4);
  REQUIRE(std::sscanf(svg.c_str() + svg.find("<circle"), "<circle cx=\"%lf\" cy=\"%lf\"", &x, &y) ==
          2);
  CHECK(x == Approx((left + right) / 2).margin(0.1));
  CHECK(y == Approx((top + bottom) / 2).margin(0.1));
}

TEST_CASE("a table's columns line up") {
  const std::string text = FormatText({"Caption", {"case", "ms"}, {{"a", "1"}, {"long", "100"}}});
  CHECK(text == "Caption\n  case   ms\n  a       1\n  long  100\n");
}

TEST_CASE("numbers read like people write them") {
  CHECK(Number(0.012345) == "0.0123");
  CHECK(Number(1234.4) == "1234");
  CHECK(Number(3.14e-7) == "3.14e-07");
}

TEST_CASE("bad arguments end the program with status 2 and the valid values") {
  const auto words = GENERATE(std::vector<std::string>{}, std::vector<std::string>{"nothing"},
                              std::vector<std::string>{"paper", "--what"},
                              std::vector<std::string>{"paper", "--out"});
  std::vector<std::string> command = {torquer::test::kStudyProgram};
  command.insert(command.end(), words.begin(), words.end());
  ChildProcess program(command);
  CHECK(program.Wait() == 2);
  CHECK(program.Output().empty());
  CHECK(program.Error().find("See 'torquer-study") != std::string::npos);
}

// Rows of a CSV file as numbers, without its heading.
std::vector<std::vector<double>> ReadRows(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  std::vector<std::vector<double>> rows;
  while (std::getline(file, line)) {
    std::stringstream cells(line);
    std::string cell;
    rows.emplace_back();
    while (std::getline(cells, cell, ',')) rows.back().push_back(std::stod(cell));
  }
  return rows;
}

TEST_CASE("A trace has every attempt of every tick, and changes none") {
  const test::SceneFile file(test::kFriction);
  const std::string script = file.Beside("script.csv");
  {
    std::ofstream text(script);
    text << "time_s,guidewire.insertion_mm,guidewire.rotation_rad\n";
    for (int k = 0; k <= 40; ++k) {
      text << 0.01 * k << ',' << 120 + 0.7 * k << ',' << 0.1 * k << '\n';
    }
  }
  ChildProcess program({torquer::test::kStudyProgram, "trace", file.path(), script, "--out",
                        file.Beside("results")});
  REQUIRE(program.Wait() == 0);

  // The same motion without a recording.
  scene::Scene scene(file.path());
  simulator::Simulation simulation(scene);
  RowRun motion(simulation);
  std::vector<TickReport> ticks;
  for (const ScriptRow& row : ReadScript(script, scene.path(), InstrumentsOf(scene))) {
    motion.GoTo(row.command, [&](const StepReport&) {
      ticks.push_back(simulation.report());
      return true;
    });
  }

  enum Column { kTick, kTime, kAttempt, kAccepted, kResidual, kEnergy };
  const auto rows = ReadRows(file.Beside("results/trace_attempts.csv"));
  std::vector<int> attempts(ticks.size()), accepted(ticks.size());
  for (const std::vector<double>& row : rows) {
    REQUIRE(row.size() == 12);
    const auto tick = static_cast<std::size_t>(row[kTick]) - 1;
    REQUIRE(tick < ticks.size());
    ++attempts[tick];
    CHECK(row[kAttempt] == attempts[tick]);
    accepted[tick] += row[kAccepted] == 1;
    CHECK(row[kResidual] >= 0);
  }
  int stalls = 0;
  for (std::size_t k = 0; k < ticks.size(); ++k) {
    INFO("tick " << k + 1);
    CHECK(accepted[k] + ticks[k].stalled == ticks[k].iterations);
    CHECK(attempts[k] >= ticks[k].iterations);
    CHECK(attempts[k] <= ticks[k].work);
    stalls += ticks[k].stalled;
  }
  CHECK(stalls == 0);
  CHECK(program.Output().find(std::to_string(ticks.size()) + " ticks") != std::string::npos);
}

}  // namespace
}  // namespace torquer::study
