// Division of a script's rows into ticks.
#include "host/api/script_ticks.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

using torquer::ScriptTicks;

namespace {

using Row = torquer::Command;

Row At(double time_s, double insertion_mm, double rotation_rad) {
  Row command;
  command.time_s = time_s;
  command.hands = {{insertion_mm, rotation_rad}};
  return command;
}

std::vector<Row> TicksOf(const Row& before, const Row& row, double step_s) {
  ScriptTicks ticks(before, row, step_s);
  std::vector<Row> all;
  for (Row tick; ticks.Next(tick);) {
    CHECK(ticks.done() == (tick.time_s == row.time_s));
    all.push_back(tick);
  }
  CHECK(ticks.done());
  return all;
}

TEST_CASE("Ticks end at the multiples of the step, and at the row") {
  const std::vector<Row> ticks = TicksOf(At(0.0125, 0, 0), At(0.0291, 1, 0), 0.005);
  REQUIRE(ticks.size() == 4);
  const double ends_s[] = {0.015, 0.020, 0.025, 0.0291};
  for (std::size_t i = 0; i < 4; ++i) CHECK(ticks[i].time_s == Approx(ends_s[i]).epsilon(1e-12));
}

TEST_CASE("Rounding at the end of a row makes no empty tick") {
  // 0.1 has no exact binary form: its sums differ from the multiples of 0.005.
  double time_s = 0;
  for (int row = 0; row < 2000; ++row) {
    const double next_s = time_s + 0.1;
    CHECK(TicksOf(At(time_s, 0, 0), At(next_s, 0, 0), 0.005).size() == 20);
    time_s = next_s;
  }
}

TEST_CASE("The same motion has the same ticks however it is cut into rows") {
  constexpr double kStep_s = 0.001;
  const std::vector<Row> whole = TicksOf(At(0, 2, 1), At(2, 42, -3), kStep_s);
  REQUIRE(whole.size() == 2000);
  std::mt19937 random(7);
  std::vector<Row> pieces;
  for (Row before = At(0, 2, 1); before.time_s < 2;) {
    const double time_s = std::min(2.0, before.time_s + 0.001 * (1 + random() % 40));
    const Row row = At(time_s, 2 + 20 * time_s, 1 - 2 * time_s);
    for (const Row& tick : TicksOf(before, row, kStep_s)) pieces.push_back(tick);
    before = row;
  }
  REQUIRE(pieces.size() == whole.size());
  for (std::size_t i = 0; i < whole.size(); ++i) {
    REQUIRE(pieces[i].time_s == Approx(whole[i].time_s).epsilon(1e-9));
    REQUIRE(pieces[i].hands[0].insertion_mm == Approx(2 + 20 * whole[i].time_s).epsilon(1e-9));
    REQUIRE(whole[i].hands[0].insertion_mm == Approx(2 + 20 * whole[i].time_s).epsilon(1e-9));
    REQUIRE(pieces[i].hands[0].rotation_rad == Approx(1 - 2 * whole[i].time_s).margin(1e-9));
  }
}

TEST_CASE("All but the hands is as the row has it") {
  Row row = At(1, 1, 0);
  row.xray = true;
  row.lao_deg = 30;
  for (const Row& tick : TicksOf(At(0, 0, 0), row, 0.25)) {
    CHECK(tick.xray);
    CHECK(tick.lao_deg == 30);
  }
}

TEST_CASE("Without a step each row is one tick with the values of the row") {
  const std::vector<Row> ticks =
      TicksOf(At(3, 0, 0), At(4000, 7, 8), std::numeric_limits<double>::infinity());
  REQUIRE(ticks.size() == 1);
  CHECK(ticks[0].time_s == 4000);
  CHECK(ticks[0].hands[0].insertion_mm == 7);
  CHECK(ticks[0].hands[0].rotation_rad == 8);
}

TEST_CASE("A row of a month does not run out of ticks") {
  const Row before = At(0, 0, 0);
  const Row row = At(3e6, 3e6, 0);
  ScriptTicks ticks(before, row, 1e-3);
  Row tick;
  for (int i = 1; i <= 1000; ++i) REQUIRE(ticks.Next(tick));
  CHECK(tick.time_s == Approx(1));
  CHECK_FALSE(ticks.done());
}

}  // namespace
