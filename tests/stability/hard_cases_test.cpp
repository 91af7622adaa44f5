// Hard cases with every method: the wire's geometry must stay valid.
#include "host/study/cases/hard_cases.h"

#include <catch2/catch.hpp>
#include <cstdlib>

#include "tests/support/sanitizer.h"

namespace torquer::study {
namespace {

// TORQUER_SEED=N draws other cases; a failure prints its seed.
unsigned Seed() {
  const char* text = std::getenv("TORQUER_SEED");
  return text == nullptr ? 1 : static_cast<unsigned>(std::strtoul(text, nullptr, 10));
}

void Run(const HardCase& hard, Way way, unsigned seed) {
  const HardOutcome outcome = RunHardCase(hard, way, seed);
  INFO(hard.name << ", " << NameOf(way) << ", TORQUER_SEED=" << seed << ": " << outcome.ticks
                 << " ticks, " << outcome.converged << " converged, " << outcome.snaps
                 << " snaps, deepest " << outcome.deepest_mm << " mm, last residual "
                 << outcome.last_residual);
  CHECK_THAT(Objection(hard, way, outcome), Catch::Equals(""));
}

// Under a sanitizer, every case and every method is tested, but not every pair.
bool Chosen(std::size_t hard, Way way) {
  return !test::kUnderSanitizer || (hard + Seed()) % 3 == static_cast<std::size_t>(way);
}

void RunAll(Way way) {
  const auto& cases = HardCases();
  for (std::size_t k = 0; k < cases.size(); ++k) {
    if (!Chosen(k, way)) continue;
    if (way != Way::kPaper || cases[k].for_paper) Run(cases[k], way, Seed());
  }
}

TEST_CASE("Hard cases stay stable: Newton") { RunAll(Way::kNewton); }
TEST_CASE("Hard cases stay stable: Newton with friction") { RunAll(Way::kNewtonWithFriction); }
TEST_CASE("Hard cases stay stable: the paper's method") { RunAll(Way::kPaper); }

TEST_CASE("Wires, walls and hands drawn at random stay stable") {
  const HardCase hard = HardCases().back();
  REQUIRE(hard.name == "anything at random");
  for (unsigned k = 0; k < static_cast<unsigned>(test::Rounds(6, 6)); ++k) {
    for (const Way way : {Way::kNewton, Way::kNewtonWithFriction, Way::kPaper}) {
      Run(hard, way, Seed() + k);
    }
  }
}

}  // namespace
}  // namespace torquer::study
