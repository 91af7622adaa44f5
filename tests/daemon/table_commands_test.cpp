// Commands for the table: their times and contents.
#include "host/daemon/table_commands.h"

#include <catch2/catch.hpp>

using torquer::daemon::TableCommands;
using torquer::daemon::TablePlace;

TEST_CASE("A table that moves is commanded every 8 ms, and at rest ten times a second") {
  TableCommands commands;
  constexpr std::int64_t kStartUs = 5'000'000;
  CHECK(commands.Next({}, kStartUs, "guidewire") == nullptr);
  int sent = 0;
  const torquer_lcm::table_command_t* last = nullptr;
  for (int ms = 1; ms <= 80; ++ms) {
    const auto* const command =
        commands.Next({.left_mm = 0.1 * ms}, kStartUs + 1000 * ms, "guidewire");
    if (command == nullptr) continue;
    ++sent;
    last = command;
  }
  CHECK(sent == 10);
  REQUIRE(last != nullptr);
  CHECK(last->instrument == "guidewire");
  CHECK(last->sequence == 10);
  CHECK(last->publish_us == kStartUs + 73'000);
  CHECK(last->left_mm == Approx(7.3));

  // The position at rest is sent too, and repeated.
  const TablePlace rest{.left_mm = 8, .head_mm = -2, .height_mm = 3};
  sent = 0;
  for (int ms = 81; ms < 1081; ++ms) {
    if (commands.Next(rest, kStartUs + 1000 * ms, "guidewire") != nullptr) ++sent;
  }
  CHECK(sent == 10);
  CHECK(last->left_mm == 8);
  CHECK(last->head_mm == -2);
  CHECK(last->height_mm == 3);
}
