// Conversations of transcripts.h with a real device, for owners of one, and a measurement of its
// jitter and latency. README.md explains how to run it.
#include <cstdlib>
#include <iostream>
#include <string>

#include "tests/hil/timing_report.h"
#include "tests/hil/transcripts.h"

namespace {

using namespace torquer::hil;

constexpr double kReportSeconds = 30;
constexpr double kMostShadingAcross = 1.25;  // as calibration/focus.cpp judges it
constexpr double kLeastShare = 0.9;          // less than a quarter of a frame lost

constexpr int kSkipped = 77;

// Without a board the program ends as skipped, with the reason.
void NeedBoard() {
  libusb_context* context = nullptr;
  REQUIRE(libusb_init(&context) == 0);
  libusb_device_handle* const handle = libusb_open_device_with_vid_pid(
      context, torquer::protocol::kUsbVendorId, torquer::protocol::kUsbProductId);
  if (handle == nullptr) {
    std::cout << "skipped: no bench device is plugged in that this user may open" << std::endl;
    std::exit(kSkipped);
  }
  libusb_close(handle);
  libusb_exit(context);
}

struct Board {
  Board() {
    NeedBoard();
    program.Open();
  }
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

// Points that only silicon settles: hardware/README.md, "Proven and open points".
TEST_CASE("the board serves rows of requests", "[board][silicon]") {
  Board board;
  ServesRowsOfRequests(board.program, 1000);
}
TEST_CASE("the board's sensor shows no rest mode to a hand that is still", "[board][silicon]") {
  Board board;
  std::cout << "leave the wire alone for a minute" << std::endl;
  RestsWithoutFault(board.program, 60000);
}
TEST_CASE("the board's sensor runs without an image", "[board][silicon]") {
  Board board;
  RunsWithoutAnImage(board.program);
}
TEST_CASE("the board's lamp shades the view along the pipe", "[board][silicon]") {
  Board board;
  const torquer::calibration::FocusFigures figures = LampFigures(board.program);
  std::cout << "shading along the pipe " << figures.shading_along << ", across it "
            << figures.shading_across << std::endl;
  CHECK(figures.shading_along > figures.shading_across);
  CHECK(figures.shading_across < kMostShadingAcross);
}
TEST_CASE("the board loses no motion when the burst is armed again", "[board][silicon][hand]") {
  Board board;
  std::cout << "push and pull the wire steadily, 100 mm a second, for 10 s from now on"
            << std::endl;
  const double share = LeastShareOfMotion(board.program, 10000);
  std::cout << "motion in the frames of the sensor's checks: " << share << " of the mean"
            << std::endl;
  CHECK(share > kLeastShare);
}

TEST_CASE("the board's jitter and latency", "[board][timing]") {
  NeedBoard();
  std::cout << "reading for " << kReportSeconds << " s" << std::endl;
  std::cout << TimingReport("", kReportSeconds) << std::endl;
}
