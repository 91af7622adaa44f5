// Conversations of transcripts.h with the real firmware, in the emulator behind a mocked usbfs.
#include "tests/hil/transcripts.h"

#include <cstdlib>

#include "host/emulator/umockdev_front.h"
#include "protocol/firmware_image.h"
#include "tests/hil/board_report.h"
#include "tests/hil/timing_report.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace {

using namespace torquer::hil;
using torquer::emulator::BenchDevice;
using torquer::emulator::BenchOptions;
using torquer::emulator::FirmwareImage;
using torquer::emulator::HandState;
using torquer::emulator::UmockdevBench;
using torquer::emulator::UsbHost;
using torquer::test::ChildProcess;

HandState Resting(double) { return {}; }

HandState Pushing(double time_s) {
  HandState hand;
  hand.insertion_mm = 100 * time_s;
  return hand;
}

struct Bench {
  explicit Bench(const BenchOptions& options = {}, HandState (*hand)(double) = Resting,
                 const std::string& image = "torquer-firmware.elf")
      : device(FirmwareImage(torquer::test::FirmwarePath(image)), options, hand) {
    program.Open();
  }
  // Reads reports until the sensors run.
  void AwaitSensor() {
    int good = 0;
    for (int i = 0; i < 3000 && good < 4; ++i) {
      const bool fault = (program.ReadReport().flags & torquer::protocol::kFlagSensorFault) != 0;
      good = fault ? 0 : good + 1;
    }
    REQUIRE(good == 4);
  }
  ~Bench() {
    program.Close();
    device.Do([](BenchDevice& bench, UsbHost&) { CHECK(bench.violation_count() == 0); });
  }
  UmockdevBench device;
  Program program;
};

}  // namespace

TEST_CASE("the device describes itself") {
  Bench bench;
  DescribesItself(bench.program);
}
TEST_CASE("a device with another sensor converses as one with a PMW3360") {
  BenchOptions options;
  options.sensor_kind = torquer::emulator::SensorKind::kPmw3389;
  Bench bench(options);
  DescribesItself(bench.program);
  SendsEveryFrame(bench.program, 200, 0);
  KeepsItsConfiguration(bench.program);
  RefusesNonsense(bench.program);
  HaltsAndGoesOn(bench.program);
  IsInGoodHealth(bench.program);
}
TEST_CASE("a second board with another sensor has every conversation of the first") {
  BenchOptions options;
  options.sensor_kind = torquer::emulator::SensorKind::kPmw3389;
  Bench bench(options, Resting, "torquer-firmware-two-sensors.elf");
  const auto identity =
      bench.program.Get<torquer::protocol::IdentityReport>(torquer::protocol::kIdentityReportId);
  CHECK(identity.board == torquer::protocol::kBoardTwoSensorsAtmega32u4);
  CHECK((identity.capabilities & torquer::protocol::kCapabilitySecondSensor) != 0);
  DescribesItself(bench.program);
  bench.AwaitSensor();
  SendsEveryFrame(bench.program, 200, 0);
  IsInGoodHealth(bench.program);
  KeepsItsConfiguration(bench.program);
  RefusesNonsense(bench.program);
  HaltsAndGoesOn(bench.program);
  OutlivesGivenUpTransfers(bench.program);
  ServesRowsOfRequests(bench.program, 20);
  RestsWithoutFault(bench.program, 700);
  RunsWithoutAnImage(bench.program);
  RestartsByItsWatchdog(bench.program);
  bench.AwaitSensor();
  CHECK(bench.program.Get<torquer::protocol::IdentityReport>(torquer::protocol::kIdentityReportId)
            .second_product_id == 0x47);
}
TEST_CASE("the device sends in every frame") {
  Bench bench;
  SendsEveryFrame(bench.program, 1000, 0);
}
TEST_CASE("the device keeps its configuration") {
  Bench bench;
  KeepsItsConfiguration(bench.program);
}
TEST_CASE("the device refuses nonsense") {
  Bench bench;
  RefusesNonsense(bench.program);
}
TEST_CASE("the device halts and continues") {
  Bench bench;
  HaltsAndGoesOn(bench.program);
}
TEST_CASE("the device outlives transfers that are given up") {
  Bench bench;
  OutlivesGivenUpTransfers(bench.program);
}
TEST_CASE("the device restarts by its watchdog") {
  Bench bench;
  RestartsByItsWatchdog(bench.program);
}
TEST_CASE("the device is in good health") {
  Bench bench;
  IsInGoodHealth(bench.program);
}

TEST_CASE("the device serves rows of requests") {
  Bench bench;
  ServesRowsOfRequests(bench.program, 20);
}
TEST_CASE("the device's sensor shows no rest mode to a hand that is still") {
  Bench bench;
  bench.AwaitSensor();
  RestsWithoutFault(bench.program, 700);
}
TEST_CASE("the device's sensor runs without an image") {
  Bench bench;
  RunsWithoutAnImage(bench.program);
}
TEST_CASE("the lamp shades the view along the pipe, and light from the side is seen") {
  BenchOptions options;
  const bool from_the_side = GENERATE(false, true);
  if (from_the_side) options.optics.side_shading = 1.6;
  Bench bench(options);
  bench.AwaitSensor();
  const torquer::calibration::FocusFigures figures = LampFigures(bench.program);
  CAPTURE(from_the_side, figures.shading_along, figures.shading_across);
  CHECK((figures.shading_along > figures.shading_across) != from_the_side);
  CHECK((figures.shading_across < 1.25) != from_the_side);
}
TEST_CASE("motion that is lost when the burst is armed again is seen") {
  BenchOptions options;
  options.sensor.arming_clears = GENERATE(false, true);
  Bench bench(options, Pushing);
  bench.AwaitSensor();
  const double share = LeastShareOfMotion(bench.program, 1000);
  CAPTURE(options.sensor.arming_clears, share);
  CHECK((share > 0.9) != options.sensor.arming_clears);
}
TEST_CASE("without a board, the test of a board says so and is skipped") {
  ChildProcess board({torquer::test::ProgramPath("helpers/board_test"), "[silicon]"});
  CHECK(board.Wait() == 77);
  CHECK(board.Output().find("skipped: no bench device is plugged in") != std::string::npos);
}

// Figures of a mocked bus have no meaning; the test only checks that the report can be made.
TEST_CASE("jitter and latency are reported") {
  Bench bench;
  bench.program.Close();
  const std::string report = TimingReport("", 0.5);
  CAPTURE(report);
  for (const char* line :
       {"reports", "between arrivals", "between samples", "from sample to", "feature report"}) {
    CHECK(report.find(line) != std::string::npos);
  }
}

// The figures hold for this emulated device only, not for silicon.
TEST_CASE("a board report has every part, with the reason for a missing one") {
  const torquer::test::TemporaryFolder folder;
  setenv("XDG_CONFIG_HOME", folder.Path().c_str(), 1);
  Bench bench;
  bench.program.Close();
  BoardReportRequest request;
  request.seconds = 1;
  const std::string report = BoardReport(request);
  unsetenv("XDG_CONFIG_HOME");
  CAPTURE(report);
  for (const char* line :
       {"Torquer 0.", "USB 1209:0001, serial number ", "crystal 16 MHz, CPU 16 MHz",
        "sensor: product 0x42", "application good, settings good, sensor good",
        "## Fuses\nnot read: give --fuses", "between arrivals", "feature report",
        "surface quality (SQUAL): median ", "flags 0x00 in ", "longest_frame_us ",
        "sensor_faults 0,", ".toml: No such file"}) {
    CHECK(report.find(line) != std::string::npos);
  }
  CHECK(report.find("\n## Camera\n") != std::string::npos);
  CHECK(report.find("cannot be had") == std::string::npos);
}
