// Conversations of transcripts.h with a real device, for owners of one, and a measurement of its
// jitter and latency. README.md explains how to run it.
#include <cstdio>
#include <iostream>
#include <string>

#include "tests/hil/timing_report.h"
#include "tests/hil/transcripts.h"

namespace {

using namespace torquer::hil;

constexpr double kReportSeconds = 30;

struct Board {
  Board() { program.Open(); }
  Program program;
};

}  // namespace

TEST_CASE("the board describes itself", "[board]") {
  Board board;
  DescribesItself(board.program);
}
TEST_CASE("the board sends in every frame", "[board]") {
  Board board;
  // One synchronous transfer at a time: a late machine occasionally misses a frame.
  SendsEveryFrame(board.program, 10000, 20);
}
TEST_CASE("the board keeps its configuration", "[board]") {
  Board board;
  KeepsItsConfiguration(board.program);
}
TEST_CASE("the board refuses nonsense", "[board]") {
  Board board;
  RefusesNonsense(board.program);
}
TEST_CASE("the board halts and continues", "[board]") {
  Board board;
  HaltsAndGoesOn(board.program);
}
TEST_CASE("the board outlives transfers that are given up", "[board]") {
  Board board;
  OutlivesGivenUpTransfers(board.program);
}
TEST_CASE("the board restarts by its watchdog", "[board]") {
  Board board;
  for (int round = 0; round < 5; ++round) RestartsByItsWatchdog(board.program);
}
TEST_CASE("the board is in good health", "[board]") {
  Board board;
  IsInGoodHealth(board.program);
}

TEST_CASE("the board is unplugged and plugged in again", "[board][cable]") {
  Board board;
  const torquer::protocol::InputReport before = board.program.ReadReport();
  std::cout << "pull the cable, and plug it in again" << std::endl;
  std::vector<unsigned char> packet;
  int result = 0;
  for (int i = 0; i < 60000 && result == 0; ++i) result = board.program.ReadInput(&packet);
  REQUIRE(result != 0);
  board.program.OpenAgain();
  CHECK(board.program.ReadReport().boot_id != before.boot_id);
  const auto diagnostics = board.program.Get<torquer::protocol::DiagnosticsReport>(
      torquer::protocol::kDiagnosticsReportId);
  CHECK((diagnostics.reset_reason & 1) == 1);
}

TEST_CASE("the board's jitter and latency", "[board][timing]") {
  std::cout << "reading for " << kReportSeconds << " s" << std::endl;
  std::cout << TimingReport("", kReportSeconds) << std::endl;
}
