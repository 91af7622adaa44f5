#include "firmware/src/settings.h"

#include <catch2/catch.hpp>
#include <random>

#include "protocol/eeprom_layout.h"
#include "tests/firmware/fake_board.h"

namespace torquer::firmware {
namespace {

void Finish(Settings* settings) {
  for (int i = 0; i < 100; ++i) settings->Poll();
}

Settings Loaded() {
  Settings settings;
  settings.Load();
  return settings;
}

void Store(std::uint16_t cpi, std::uint16_t deadzone) {
  Settings settings = Loaded();
  REQUIRE(settings.Set(cpi, deadzone, 0));
  Finish(&settings);
}

TEST_CASE("a blank EEPROM gives the defaults and is not written") {
  NewBoard();
  Settings settings = Loaded();
  CHECK(settings.cpi() == Settings::kDefaultCpi);
  CHECK(settings.deadzone() == Settings::kDefaultDeadzone);
  CHECK(settings.good());
  Finish(&settings);
  CHECK(board().eeprom_writes == 0);
}

TEST_CASE("settings survive a loss of power") {
  NewBoard();
  Store(3200, 25);
  const Settings settings = Loaded();
  CHECK(settings.cpi() == 3200);
  CHECK(settings.deadzone() == 25);
  CHECK(settings.writes() == 1);
}

TEST_CASE("contacts that are closed at rest are kept, beside any dead zone") {
  NewBoard();
  for (std::uint8_t contacts = 0; contacts < 8; ++contacts) {
    Settings settings = Loaded();
    REQUIRE(settings.Set(1200, 511, contacts));
    Finish(&settings);
    const Settings again = Loaded();
    CHECK(again.closed_at_rest() == contacts);
    CHECK(again.deadzone() == 511);
    CHECK(again.good());
  }
  Settings settings = Loaded();
  CHECK_FALSE(settings.Set(1200, 0, 8));  // the end switch
  CHECK(settings.closed_at_rest() == 7);
}

TEST_CASE("only a change is written") {
  NewBoard();
  Store(3200, 25);
  const int writes = board().eeprom_writes;
  Store(3200, 25);
  CHECK(board().eeprom_writes == writes);
  CHECK(Loaded().writes() == 1);
}

TEST_CASE("values out of range are refused without effect") {
  NewBoard();
  Settings settings = Loaded();
  CHECK_FALSE(settings.Set(0, 0, 0));
  CHECK_FALSE(settings.Set(50, 0, 0));
  CHECK_FALSE(settings.Set(150, 0, 0));
  CHECK_FALSE(settings.Set(12100, 0, 0));
  CHECK_FALSE(settings.Set(1200, 512, 0));
  CHECK(settings.cpi() == Settings::kDefaultCpi);
  CHECK(settings.Set(100, 0, 0));
  CHECK(settings.Set(12000, 511, 0));
}

TEST_CASE("a write waits while the EEPROM is busy, and writes a byte at a time") {
  NewBoard();
  Settings settings = Loaded();
  REQUIRE(settings.Set(2000, 10, 0));
  board().eeprom_busy_polls = 3;
  for (int i = 0; i < 3; ++i) settings.Poll();
  CHECK(board().eeprom_writes == 0);
  settings.Poll();
  CHECK(board().eeprom_writes == 1);
  settings.Poll();
  CHECK(board().eeprom_writes == 2);
}

TEST_CASE("a copy is invalid from the first byte of its rewriting to the last") {
  NewBoard();
  Store(2000, 10);
  Store(2100, 11);
  Settings settings = Loaded();
  REQUIRE(settings.Set(2200, 12, 0));
  const std::uint16_t marker = protocol::kEepromSettingsAddress[0];
  REQUIRE(board().eeprom[marker] != 0xff);
  int polls = 0;
  for (; Loaded().cpi() == 2100; ++polls) {
    settings.Poll();
    const bool complete = Loaded().cpi() == 2200;
    REQUIRE((board().eeprom[marker] == 0xff) == !complete);
  }
  CHECK(polls >= 5);
}

TEST_CASE("a value set during a write is stored after it") {
  NewBoard();
  Settings settings = Loaded();
  REQUIRE(settings.Set(2000, 10, 0));
  for (int i = 0; i < 4; ++i) settings.Poll();
  REQUIRE(settings.Set(2100, 11, 0));
  Finish(&settings);
  CHECK(Loaded().cpi() == 2100);
  CHECK(Loaded().deadzone() == 11);
}

TEST_CASE("writes go on for thousands of changes, sequence and count wrapping or saturating") {
  NewBoard();
  for (int i = 0; i < 1000; ++i) {
    const auto cpi = static_cast<std::uint16_t>(100 * (1 + i % 120));
    Store(cpi, static_cast<std::uint16_t>(i % 512));
    REQUIRE(Loaded().cpi() == cpi);
    REQUIRE(Loaded().deadzone() == i % 512);
  }
  CHECK(Loaded().writes() == 1000);
}

// Power loss before or during the k-th byte write of a change must leave the former or the new
// values.
TEST_CASE("a torn write at every byte leaves the old settings or the new ones") {
  std::mt19937 random(7);
  for (const int former_changes : {0, 1, 2, 3, 300}) {
    NewBoard();
    std::uint16_t old_cpi = Settings::kDefaultCpi;
    std::uint16_t old_deadzone = Settings::kDefaultDeadzone;
    for (int i = 0; i < former_changes; ++i) {
      old_cpi = static_cast<std::uint16_t>(100 + 100 * (i % 100));
      old_deadzone = static_cast<std::uint16_t>(i);
      Store(old_cpi, old_deadzone);
    }
    const FakeBoard before = board();
    bool completed = false;
    for (int cut = 0; !completed; ++cut) {
      REQUIRE(cut < 30);
      for (int trial = 0; trial < 50; ++trial) {
        board() = before;
        board().eeprom_writes = 0;
        board().writes_until_loss = cut;
        board().tear = static_cast<FakeBoard::Tear>(trial % 3);
        board().tear_bits = static_cast<std::uint8_t>(random());
        Settings settings = Loaded();
        REQUIRE(settings.Set(11900, 477, 0));
        completed = true;
        try {
          Finish(&settings);
        } catch (const PowerLost&) {
          completed = false;
        }
        board().writes_until_loss.reset();
        const Settings after = Loaded();
        const bool is_old = after.cpi() == old_cpi && after.deadzone() == old_deadzone;
        const bool is_new = after.cpi() == 11900 && after.deadzone() == 477;
        REQUIRE((is_old || is_new));
        if (completed) REQUIRE(is_new);
        // The next change must succeed.
        Store(200, 1);
        REQUIRE(Loaded().cpi() == 200);
      }
    }
  }
}

TEST_CASE("random cuts in a row never lose both copies") {
  NewBoard();
  std::mt19937 random(11);
  std::uint16_t cpi = 1200;
  Store(1300, 3);
  cpi = 1300;
  for (int i = 0; i < 100000; ++i) {
    const auto next = static_cast<std::uint16_t>(100 * (1 + random() % 120));
    board().eeprom_writes = 0;
    board().writes_until_loss = static_cast<int>(random() % 14);
    board().tear = static_cast<FakeBoard::Tear>(random() % 3);
    board().tear_bits = static_cast<std::uint8_t>(random());
    Settings settings = Loaded();
    REQUIRE(settings.cpi() == cpi);
    REQUIRE(settings.Set(next, 3, 0));
    try {
      for (int poll = 0; poll < 20; ++poll) settings.Poll();
    } catch (const PowerLost&) {  // no error: the settings must survive it
    }
    board().writes_until_loss.reset();
    const Settings after = Loaded();
    REQUIRE((after.cpi() == cpi || after.cpi() == next));
    cpi = after.cpi();
  }
}

TEST_CASE("decayed copies are distinguished from a blank EEPROM") {
  NewBoard();
  Store(3200, 25);
  Store(3300, 26);
  for (const std::uint16_t address : protocol::kEepromSettingsAddress) {
    board().eeprom[static_cast<std::size_t>(address + 3)] ^= 4;
  }
  Settings settings = Loaded();
  CHECK_FALSE(settings.good());
  CHECK(settings.cpi() == Settings::kDefaultCpi);
  REQUIRE(settings.Set(1500, 9, 0));
  Finish(&settings);
  CHECK(settings.good());
  CHECK(Loaded().cpi() == 1500);
}

}  // namespace
}  // namespace torquer::firmware
