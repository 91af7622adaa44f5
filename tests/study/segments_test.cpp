// torquer-study segments: shares and counts that follow from its rows.
#include <catch2/catch.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "tests/study/study_program.h"
#include "tests/support/child_process.h"
#include "tests/support/temporary_folder.h"

namespace torquer::study {
namespace {

TEST_CASE(
    "The study of the estimated error counts its rows, and the estimate covers most of them") {
  const test::TemporaryFolder folder;
  test::ChildProcess program(
      {test::kStudyProgram, "segments", "--quick", "--json", "--out", folder.Path("results")});
  REQUIRE(program.Wait() == 0);
  std::map<std::string, std::map<std::string, double>> of;
  std::istringstream lines(program.Output());
  for (std::string line; std::getline(lines, line);) {
    const auto row = nlohmann::json::parse(line);
    of[row.at("case")][row.at("metric")] = row.at("value");
  }
  REQUIRE(of.size() == 5);
  const auto all = of.extract("all").mapped();
  std::map<std::string, double> sum;
  for (auto& [scene, metric] : of) {
    CAPTURE(scene);
    CHECK(metric["rows"] == 20);
    CHECK(metric["known"] <= metric["rows"]);
    CHECK(metric["announced"] <= metric["snaps"]);
    CHECK(metric["error_p50"] > 0);
    CHECK(metric["estimate_p50"] > metric["error_p50"]);
    for (const char* name : {"rows", "known", "snaps", "announced"}) sum[name] += metric[name];
    sum["covered"] += metric["covered"] * metric["known"];
  }
  for (const auto& [name, total] : sum) {
    CHECK(all.at(name) * (name == "covered" ? all.at("known") : 1) == Approx(total));
  }
  CHECK(all.at("covered") > 0.5);
}

}  // namespace
}  // namespace torquer::study
