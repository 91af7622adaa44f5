// Conversations of transcripts.h with the real firmware, in the emulator behind a mocked usbfs.
#include "tests/hil/transcripts.h"

#include <cstdlib>

#include "host/emulator/umockdev_front.h"
#include "tests/hil/board_report.h"
#include "tests/hil/timing_report.h"
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

struct Bench {
  explicit Bench(const BenchOptions& options = {})
      : device(FirmwareImage(torquer::test::FirmwarePath("torquer-firmware.elf")), options,
               [](double) { return HandState{}; }) {
    program.Open();
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
