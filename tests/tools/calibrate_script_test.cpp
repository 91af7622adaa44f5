#include "host/tools/calibrate_script.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "host/support/error.h"
#include "host/tools/calibrate_source.h"
#include "tests/support/paths.h"

namespace {

using Catch::Contains;
using torquer::tools::PacedOperator;
using torquer::tools::ParseScript;
using torquer::tools::Script;
using torquer::tools::ScriptedDevice;
using torquer::tools::Statement;

constexpr char kFirst[] = "torquer-calibrate script 1\n";

Script Parse(const std::string& text) { return ParseScript(kFirst + text, "a.script"); }

}  // namespace

TEST_CASE("A script is read line by line") {
  const Script script = Parse(
      "# a comment\n"
      "\n"
      "device BENCH-7 1600  # another\n"
      "move 12.5 -3 0.4\n"
      "  mark\n"
      "skip raised");
  REQUIRE(script.statements.size() == 4);
  CHECK(script.statements[0].kind == Statement::Kind::kDevice);
  CHECK(script.statements[0].word == "BENCH-7");
  CHECK(script.statements[0].numbers == std::vector<double>{1600});
  CHECK(script.statements[1].kind == Statement::Kind::kMove);
  CHECK(script.statements[1].numbers == std::vector<double>{12.5, -3, 0.4});
  CHECK(script.statements[1].line == 5);
  CHECK(script.statements[2].kind == Statement::Kind::kMark);
  CHECK(script.statements[3].kind == Statement::Kind::kSkip);
  CHECK(script.statements[3].word == "raised");
}

TEST_CASE("The sample script needs no more travel than the device has") {
  const Script script =
      torquer::tools::ReadScript(torquer::test::SourcePath("/calibration/sample.script"));
  constexpr double kCountsPerMm = 1200 / 25.4;
  double axial = 0, low = 0, high = 0;
  for (const Statement& statement : script.statements) {
    CHECK(statement.kind != Statement::Kind::kLift);  // the cylinder never leaves the sensor
    if (statement.kind != Statement::Kind::kMove) continue;
    // The turns come last. Their axial counts are a sensor's misalignment, and no travel.
    if (std::abs(statement.numbers[1]) > std::abs(statement.numbers[0]) + 1000) break;
    axial += statement.numbers[0];
    low = std::min(low, axial);
    high = std::max(high, axial);
  }
  CHECK((high - low) / kCountsPerMm < 151);
}

TEST_CASE("A bad script is refused with file, line and remedy") {
  const auto [text, expected] = GENERATE(table<std::string, std::string>({
      {"dance", "a.script:2: 'dance' is unknown; known statements:\n  mark\n"},
      {"mark\nmove 1 2", "a.script:3: it has 2 values; write 'move AXIAL TRANSVERSE SECONDS'"},
      {"rest -1", "SECONDS = '-1': must be a number from 0 to 3600"},
      {"rest nan", "SECONDS = 'nan': must be a number"},
      {"rest 1s", "SECONDS = '1s': must be a number"},
      {"joystick 0 1024 1", "Y = '1024': must be a number from 0 to 1023"},
      {"skip pushes", "the step 'pushes' cannot be skipped"},
  }));
  CAPTURE(text);
  CHECK_THROWS_WITH(Parse(text), Contains(expected));
}

TEST_CASE("A file that is not a script is refused") {
  CHECK_THROWS_WITH(ParseScript("mark\n", "a.script"),
                    Contains("a.script:1: 'mark': a script begins with the line "
                             "'torquer-calibrate script 1'"));
  CHECK_THROWS_WITH(ParseScript("", "a.script"), Contains("it is empty"));
  CHECK_THROWS_WITH(torquer::tools::ReadScript("/nowhere/a.script"),
                    Contains("/nowhere/a.script: cannot be read"));
}

TEST_CASE("A script moves its own device, or none") {
  CHECK_THROWS_WITH(PacedOperator(nullptr, Parse("mark\nrest 1")),
                    Contains("a.script:3: a script cannot move the device of --source"));
  ScriptedDevice device(Parse("mark"));
  CHECK_THROWS_WITH(device.Connect(), Contains("begins with the statement 'device SERIAL CPI'"));
}
