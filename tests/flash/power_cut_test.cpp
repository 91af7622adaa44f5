// Power loss during every page erase and page write of an update, and during the commit. The board
// must always recover, and a second run of the tool must finish the update.
#include <catch2/catch.hpp>
#include <cstdlib>

#include "tests/flash/emulated_boards.h"
#include "tests/support/sanitizer.h"

namespace {

using torquer::emulator::BenchOptions;
using torquer::test::EmulatedBoards;
using torquer::test::kNewHex;
using torquer::test::kNewVersion;
using torquer::test::WithApplication;
using torquer::tools::BoardMode;
using torquer::tools::FlashImage;
using torquer::tools::FlashUnfinished;

// Board in its bootloader with the old firmware.
void Prepare(EmulatedBoards& boards) { REQUIRE(boards.ResetByPin() == BoardMode::kBootloader); }

// Page operations: erase of the trailer, then erase and write of each page and of the trailer.
int Operations() { return 1 + 2 * (FlashImage::FromFile(kNewHex).pages() + 1); }

// The cuts are divided into parts, so that these tests can run in parallel.
constexpr int kParts = 8;
constexpr int kStride = torquer::test::kUnderSanitizer ? 6 * kParts : kParts;

void CutEvery(int part) {
  BenchOptions options;
  options.page_operation_us = 400;  // a tenth of the chip's, to save time
  const int operations = Operations();
  for (int cut = 1 + part; cut <= operations; cut += kStride) {
    CAPTURE(cut, operations);
    EmulatedBoards boards(WithApplication(), options);
    Prepare(boards);
    boards.device.CutPowerAtPageOperation(cut);
    CHECK_THROWS_AS(boards.Flash(kNewHex), FlashUnfinished);
    CHECK_FALSE(boards.device.powered());
    CHECK(boards.device.page_operations() == cut);

    const BoardMode mode = boards.Start();
    // A cut during the last write may still leave a complete trailer.
    if (cut < operations) CHECK(mode == BoardMode::kBootloader);
    const auto outcome = boards.Flash(kNewHex);
    REQUIRE(outcome);
    CHECK(outcome->version == kNewVersion);
    CHECK(outcome->application_good);
    boards.CheckRules();
  }
}

}  // namespace

TEST_CASE("an update has the page operations that are cut below") {
  EmulatedBoards boards(WithApplication());
  Prepare(boards);
  boards.Flash(kNewHex);
  CHECK(boards.device.page_operations() == Operations());
}

TEST_CASE("power cut at page operations 1, 9, ..") { CutEvery(0); }
TEST_CASE("power cut at page operations 2, 10, ..") { CutEvery(1); }
TEST_CASE("power cut at page operations 3, 11, ..") { CutEvery(2); }
TEST_CASE("power cut at page operations 4, 12, ..") { CutEvery(3); }
TEST_CASE("power cut at page operations 5, 13, ..") { CutEvery(4); }
TEST_CASE("power cut at page operations 6, 14, ..") { CutEvery(5); }
TEST_CASE("power cut at page operations 7, 15, ..") { CutEvery(6); }
TEST_CASE("power cut at page operations 8, 16, ..") { CutEvery(7); }
