// Record of the actions on a simulation.
#include "host/api/past.h"

#include <catch2/catch.hpp>
#include <cstdint>
#include <functional>
#include <string>

#include "tests/support/sanitizer.h"

using torquer::Command;
using torquer::Past;

TEST_CASE("A long past is copied and released without deep recursion", "[api]") {
  Past past;
  Command row{.hands = {{.insertion_mm = 1, .rotation_rad = 2}}};
  constexpr int kSteps = torquer::test::Rounds(3'000'000, 6);
  for (int k = 0; k < kSteps; ++k) {
    row.time_s = k;
    past.BeginStep(row);
    past.AddTick();
    past.EndStep();
  }
  Past copy = past;
  past = {};
  int steps = 0;
  double last_s = 0;
  Past::Repeat(copy.Bytes(), 1,
               {.step =
                    [&](const Command& again, const std::function<bool(std::uint32_t)>&) {
                      ++steps;
                      last_s = again.time_s;
                      return 1U;
                    },
                .render = [](int) {},
                .exchange = [](std::size_t, const std::string&, std::uint64_t) {}});
  CHECK(steps == kSteps);
  CHECK(last_s == kSteps - 1);
}
