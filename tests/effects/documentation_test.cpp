// Documentation tests: the README and the printed list must name every effect.
#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>

#include "host/simulator/effects/effect.h"
#include "tests/support/paths.h"

namespace torquer::effects {
namespace {

TEST_CASE("The effects' README names every effect") {
  std::ifstream file(torquer::test::SourcePath("/host/simulator/effects/README.md"));
  std::stringstream text;
  text << file.rdbuf();
  for (const EffectKind& kind : AllEffects()) {
    INFO(kind.name);
    CHECK(text.str().find(kind.name) != std::string::npos);
  }
}

TEST_CASE("The list of effects names each with its roles") {
  const std::string list = DescribeEffects();
  for (const EffectKind& kind : AllEffects()) {
    INFO(kind.name);
    CHECK(list.find(kind.name) != std::string::npos);
    CHECK(list.find(kind.summary) != std::string::npos);
    CHECK(list.find(kind.roles) != std::string::npos);
  }
}

}  // namespace
}  // namespace torquer::effects
