// The daemon as a user runs it, on unmodified libusb, reading the real firmware: usbfs is mocked by
// umockdev, and behind it the firmware's image runs in the emulator. Time is elastic there: frames
// wait for the daemon, so that function can be asserted on a busy machine.
#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <csignal>

#include "calibration/calibration_file.h"
#include "host/emulator/umockdev_front.h"
#include "tests/daemon/daemon_process.h"

namespace {

using torquer::emulator::BenchDevice;
using torquer::emulator::BenchOptions;
using torquer::emulator::FirmwareImage;
using torquer::emulator::HandState;
using torquer::emulator::UmockdevBench;
using torquer::emulator::UsbHost;
using torquer::test::ChildProcess;
using torquer::test::Listener;
using torquer_lcm::instrument_command_t;

constexpr double kMmPerCount = 25.4 / 1200;

// A hand that lies still until it is told to push on by 100 mm, turning by 2 rad, in a second.
class PushingHand {
 public:
  HandState operator()(double time_s) {
    if (asked_.exchange(false)) {
      from_ = to_;
      to_ += 1.0;
      start_s_ = time_s;
    }
    const double done = from_ + std::clamp(time_s - start_s_, 0.0, to_ - from_);
    HandState hand;
    hand.insertion_mm = 100.0 * done;
    hand.rotation_rad = 2.0 * done;
    return hand;
  }
  void Push() { asked_ = true; }

 private:
  std::atomic<bool> asked_ = false;
  double from_ = 0.0, to_ = 0.0, start_s_ = 0.0;
};

struct Bench {
  Bench()
      : device(FirmwareImage(TORQUER_FIRMWARE_DIR "/torquer-firmware.elf"), Options(),
               [this](double time_s) { return hand(time_s); }) {
    daemon = std::make_unique<ChildProcess>(
        std::vector<std::string>{torquer::test::kDaemonProgram, "--source", "usb", "--device",
                                 "HIL-1", "--calibration", Calibration()});
    REQUIRE(daemon->WaitForError("running: reading device HIL-1"));
    REQUIRE(listener.UntilCommands(10));
  }
  static BenchOptions Options() {
    BenchOptions options;
    options.serial = "HIL-1";
    // Over the wrap of the device's clock within the first seconds of every start.
    options.start_time_us = 4294967295u - 2500000u;
    return options;
  }
  std::string Calibration() const {
    std::string path = listener.folder.Path("calibration.toml");
    torquer::calibration::WriteCalibration(torquer::calibration::NominalCalibration("HIL-1", 1200),
                                           path);
    return path;
  }

  // Pushes once and waits for the wire to have followed by about that much.
  void PushFrom(instrument_command_t start) {  // a copy: the list that it is from grows
    hand.Push();
    REQUIRE(listener.Until([&] {
      listener.samples.clear();
      return !listener.commands.empty() &&
             listener.commands.back().insertion_mm > start.insertion_mm + 100.0 - 3 * kMmPerCount &&
             listener.commands.back().rotation_rad > start.rotation_rad + 2.0 - 0.02;
    }));
    CHECK(listener.commands.back().insertion_mm < start.insertion_mm + 100.0 + 3 * kMmPerCount);
    CHECK(listener.commands.back().rotation_rad < start.rotation_rad + 2.0 + 0.02);
  }

  Listener listener{/*with_devices=*/true};
  PushingHand hand;
  UmockdevBench device;
  std::unique_ptr<ChildProcess> daemon;
};

}  // namespace

TEST_CASE("What the firmware's sensor counts is what the instrument is moved by, count for count") {
  Bench bench;
  bench.PushFrom(bench.listener.commands.back());
  std::int64_t axial = 0;
  std::int64_t transverse = 0;
  bench.device.Do([&](BenchDevice& device, UsbHost&) {
    axial = device.sensor().axial_counts();
    transverse = device.sensor().transverse_counts();
    CHECK(device.violation_count() == 0);
  });
  CHECK(axial == Approx(100.0 / kMmPerCount).margin(2));
  REQUIRE(bench.listener.Until([&] {
    return bench.listener.counters["axial_counts_applied"] == axial &&
           bench.listener.counters["transverse_counts_applied"] == transverse;
  }));
  CHECK(bench.listener.counters["reports_lost"] == 0);
  CHECK(bench.listener.counters["reports_duplicated"] == 0);
  CHECK(bench.listener.commands.back().flags == 0);
  bench.daemon->Signal(SIGTERM);
  CHECK(bench.daemon->Wait() == 0);
}

TEST_CASE("Unplugged, reset, stalled and cut short, the chain goes on without a jump") {
  Bench bench;
  const std::size_t connection = bench.listener.commands.size();
  SECTION("unplugged and plugged in again, three times") {
    for (int round = 0; round < 3; ++round) {
      bench.device.Unplug();
      REQUIRE(bench.listener.UntilHealth("waiting for device", "was unplugged"));
      bench.listener.Forget();
      bench.device.Plug();
      REQUIRE(bench.listener.UntilHealth("running", "device HIL-1 is back"));
    }
    CHECK(bench.listener.counters["connections"] == 4);
  }
  SECTION("reset") {
    bench.device.Do([](BenchDevice& device, UsbHost&) { device.ResetByPin(); });
    REQUIRE(bench.listener.UntilHealth("running", "device HIL-1 is back"));
    REQUIRE(bench.listener.Until([&] { return bench.listener.counters["device_resets"] == 1; }));
  }
  SECTION("a stalled transfer") { bench.device.StallNextInput(); }
  SECTION("a short packet") { bench.device.ShortenNextInput(20); }
  REQUIRE(bench.listener.UntilCommands(connection + 20));
  CAPTURE(bench.daemon->Error());
  // The sensor is started anew after a loss of power; the doubt passes.
  REQUIRE(bench.listener.Until([&] { return bench.listener.commands.back().flags == 0; }));
  CHECK(bench.listener.commands.back().insertion_mm == 0.0);
  bench.PushFrom(bench.listener.commands.back());
}
