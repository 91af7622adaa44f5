#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>

#include "host/simulator/effects/effect.h"
#include "tests/support/paths.h"

namespace torquer::effects {
namespace {

TEST_CASE("The effects' README ends with the keys as the table of effects has them") {
  std::ifstream file(torquer::test::SourcePath("/host/simulator/effects/README.md"));
  std::stringstream text;
  text << file.rdbuf();
  const std::string heading = "## The effects and their keys\n";
  const auto at = text.str().find(heading);
  REQUIRE(at != std::string::npos);
  std::string expected = DescribeEffects(true);
  expected.pop_back();  // the blank line after the last
  INFO("put this after the heading:\n" << expected);
  CHECK(text.str().substr(at + heading.size()) == expected);
}

}  // namespace
}  // namespace torquer::effects
