// The daemon as a user runs it, on unmodified libusb, reading the real firmware. The library
// umockdev mocks usbfs; the firmware's image runs behind it in the emulator. Time is elastic:
// frames wait for the daemon, so that the test is reliable on a busy machine.
#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <csignal>

#include "calibration/calibration_file.h"
#include "host/device/sensor_firmware.h"
#include "host/emulator/umockdev_front.h"
#include "protocol/hid_reports.h"
#include "tests/hil/usb_daemon.h"
#include "tests/support/daemon_process.h"
#include "tests/support/emulated_bench.h"
#include "tests/support/paths.h"

namespace {

using namespace torquer::hil;
using torquer::emulator::BenchDevice;
using torquer::emulator::BenchOptions;
using torquer::emulator::HandState;
using torquer::emulator::UmockdevBench;
using torquer::emulator::UsbHost;
using torquer::test::ChildProcess;
using torquer::test::Listener;
using torquer_lcm::instrument_command_t;

struct Bench {
  Bench() : device(Image(), HilOptions("HIL-1"), [this](double time_s) { return hand(time_s); }) {
    daemon = UsbDaemon({"--device", "HIL-1", "--calibration", Calibration()});
    REQUIRE(daemon->WaitForError("running: reading device HIL-1"));
    REQUIRE(listener.UntilCommands(10));
  }
  std::string Calibration() const {
    std::string path = listener.folder.Path("calibration.toml");
    torquer::calibration::WriteCalibration(torquer::calibration::NominalCalibration("HIL-1", 1200),
                                           path);
    return path;
  }

  // Replaces the next report with these bytes; returns after its delivery.
  void ReplaceInput(const std::vector<std::uint8_t>& bytes) {
    device.ReplaceNextInput(bytes);
    const std::int64_t before = device.inputs_delivered();
    REQUIRE(listener.Until([&] { return device.inputs_delivered() > before + 1; }));
  }

  // Waits for the next connection. Commands from before it have no doubt flag, although the sensor
  // restarts and counts nothing yet: they are forgotten.
  void AwaitConnection() {
    REQUIRE(listener.UntilHealth("running", "device HIL-1 is connected again"));
    listener.Forget();
  }

  // Pushes once and waits until the wire has followed by about that distance.
  void PushFrom(instrument_command_t start) {  // a copy: its list grows
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

TEST_CASE("The instrument moves by the counts of the firmware's sensor, count for count") {
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

TEST_CASE("Each press of the stick gives it to the next: table, height of the table, C-arm") {
  Bench bench;
  const auto is_given = [&](std::int32_t flag) {
    return bench.listener.Until([&] {
      return (bench.listener.commands.back().flags &
              (torquer::protocol::kCommandStickTable | torquer::protocol::kCommandStickHeight)) ==
             flag;
    });
  };
  constexpr std::int32_t kGivenTo[] = {torquer::protocol::kCommandStickTable,
                                       torquer::protocol::kCommandStickHeight, 0};
  for (const std::int32_t flag : kGivenTo) {
    for (const int held : {static_cast<int>(torquer::protocol::kButtonStick), 0}) {
      bench.hand.Hold(static_cast<std::uint8_t>(held));
      REQUIRE(bench.listener.Until([&] {
        return !bench.listener.samples.empty() && bench.listener.samples.back().buttons == held;
      }));
      CHECK(is_given(flag));
    }
  }
}

TEST_CASE("The chain continues without a jump after unplug, reset, stall and short transfers") {
  Bench bench;
  const std::size_t connection = bench.listener.commands.size();
  SECTION("unplugged and plugged in again, three times") {
    for (int round = 0; round < 3; ++round) {
      bench.device.Unplug();
      REQUIRE(bench.listener.UntilHealth("waiting for device", "was unplugged"));
      bench.listener.Forget();
      bench.device.Plug();
      bench.AwaitConnection();
    }
    CHECK(bench.listener.counters["connections"] == 4);
  }
  SECTION("reset") {
    bench.device.Do([](BenchDevice& device, UsbHost&) { device.ResetByPin(); });
    bench.AwaitConnection();
    REQUIRE(bench.listener.Until([&] { return bench.listener.counters["device_resets"] == 1; }));
  }
  SECTION("hung, and reset by its watchdog") {
    bench.device.Do([](BenchDevice& device, UsbHost&) {
      device.chip().SetDead(torquer::emulator::Atmega32u4::Peripheral::kSpi);
    });
    REQUIRE(bench.listener.UntilHealth("waiting for device", "was unplugged"));
    bench.device.Do([](BenchDevice& device, UsbHost&) {
      CHECK(device.chip().resets() > 0);
      device.chip().SetDead(torquer::emulator::Atmega32u4::Peripheral::kNone);
    });
    bench.AwaitConnection();
  }
  SECTION("garbage") {
    std::vector<std::uint8_t> bytes(sizeof(torquer::protocol::InputReport));
    for (int i = 0; i < 10; ++i) {
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(37 * byte + 11 * i + 5);
      bytes[0] = static_cast<std::uint8_t>(i + 10);  // id of some other report
      bench.ReplaceInput(bytes);
    }
    REQUIRE(
        bench.listener.Until([&] { return bench.listener.counters["reports_wrong_id"] == 10; }));
  }
  SECTION("another protocol version for a moment") {
    torquer::protocol::InputReport report{};
    report.report_id = torquer::protocol::kInputReportId;
    report.protocol_version = torquer::protocol::kProtocolVersion + 1;
    report.axial_counts = 123456;
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(&report);
    bench.ReplaceInput({bytes, bytes + sizeof report});
    REQUIRE(bench.listener.Until(
        [&] { return bench.listener.counters["reports_wrong_version"] == 1; }));
  }
  SECTION("a stalled transfer") { bench.device.StallNextInput(); }
  SECTION("a short packet") { bench.device.ShortenNextInput(20); }
  REQUIRE(bench.listener.UntilCommands(connection + 20));
  CAPTURE(bench.daemon->Error());
  // The sensor restarts after a loss of power; the doubt flag clears.
  REQUIRE(bench.listener.Until([&] { return bench.listener.commands.back().flags == 0; }));
  CHECK(bench.listener.commands.back().insertion_mm == 0.0);
  bench.PushFrom(bench.listener.commands.back());
}

TEST_CASE("A device that answers no request in time is not taken, and is once it answers") {
  Listener listener{/*with_devices=*/true};
  UmockdevBench device(Image(), HilOptions("HIL-1"), [](double) { return HandState{}; });
  device.HangControl(true);
  const auto refused = UsbDaemon({"--uncalibrated"});
  CHECK(refused->Wait() == 2);
  CAPTURE(refused->Error());
  CHECK(refused->Error().find("no device") != std::string::npos);
  device.HangControl(false);
  const auto served = UsbDaemon({"--uncalibrated"});
  CHECK(served->WaitForError("running: reading device HIL-1"));
}

TEST_CASE("Two devices drive two instruments independently") {
  Bench bench;
  PushingHand second_hand;
  UmockdevBench second(
      Image(), HilOptions("HIL-2"), [&](double time_s) { return second_hand(time_s); },
      /*port=*/2);
  const auto catheter =
      UsbDaemon({"--device", "HIL-2", "--instrument", "catheter", "--uncalibrated"});
  REQUIRE(catheter->WaitForError("running: reading device HIL-2"));

  const auto newest = [&](const std::string& instrument) -> const instrument_command_t* {
    for (auto it = bench.listener.commands.rbegin(); it != bench.listener.commands.rend(); ++it) {
      if (it->instrument == instrument) return &*it;
    }
    return nullptr;
  };
  const auto until_pushed = [&](const std::string& instrument) {
    return bench.listener.Until([&] {
      bench.listener.samples.clear();
      const instrument_command_t* command = newest(instrument);
      return command != nullptr && command->insertion_mm > 100.0 - 3 * kMmPerCount;
    });
  };
  second_hand.Push();
  REQUIRE(until_pushed("catheter"));
  REQUIRE(newest("guidewire") != nullptr);
  CHECK(newest("guidewire")->insertion_mm == 0.0);

  second.Unplug();
  REQUIRE(catheter->WaitForError("waiting for device"));
  bench.hand.Push();
  REQUIRE(until_pushed("guidewire"));
  second.Plug();
  REQUIRE(catheter->WaitForError("device HIL-2 is connected again"));
  bench.listener.commands.clear();
  REQUIRE(bench.listener.Until([&] { return newest("catheter") != nullptr; }));
  CHECK(newest("catheter")->insertion_mm == Approx(100.0).margin(1.0));

  // --list names the reader of each device without disturbing either. It runs last, because the
  // mocked kernel reports no further plug events once a listening program has ended.
  ChildProcess list({torquer::test::kDaemonProgram, "--list"});
  CHECK(list.Wait() == 0);
  CAPTURE(list.Output());
  for (const char* serial : {"  HIL-1  ", "  HIL-2  "}) {
    const std::size_t at = list.Output().find(serial);
    REQUIRE(at != std::string::npos);
    CHECK(list.Output().substr(at, list.Output().find('\n', at) - at).find("read by process ") !=
          std::string::npos);
  }
}

TEST_CASE("The sensor's firmware image is in it again after a suspend, a reset and a re-plug") {
  Listener listener{/*with_devices=*/true};
  const std::vector<std::uint8_t> image = torquer::emulator::TestSrom();
  REQUIRE(torquer::device::KeepSrom("HIL-1", image) == listener.folder.Path("torquer/HIL-1.srom"));
  UmockdevBench device(Image(), HilOptions("HIL-1"), [](double) { return HandState{}; });
  const auto daemon = UsbDaemon({"--uncalibrated"});
  const auto runs_it = [&](std::int64_t loads) {
    const bool loaded =
        listener.Until([&] { return listener.counters["sensor_images_loaded"] == loads; });
    device.Do([&](BenchDevice& bench, UsbHost&) { CHECK(bench.sensor().srom() == image); });
    return loaded;
  };
  const auto sleeps = [&] {
    bool asleep = false;
    device.Do([&](BenchDevice& bench, UsbHost&) { asleep = bench.PartsAwake().empty(); });
    return asleep;
  };
  CAPTURE(daemon->Error());
  REQUIRE(runs_it(1));

  device.Do([](BenchDevice&, UsbHost& host) { host.Suspend(); });
  REQUIRE(listener.Until(sleeps));
  device.Do([](BenchDevice&, UsbHost& host) { host.Resume(); });
  REQUIRE(runs_it(2));

  device.Do([](BenchDevice& bench, UsbHost&) { bench.ResetByPin(); });
  REQUIRE(runs_it(3));

  device.Unplug();
  REQUIRE(listener.UntilHealth("waiting for device", "was unplugged"));
  device.Plug();
  REQUIRE(runs_it(4));
  device.Do([](BenchDevice& bench, UsbHost&) { CHECK(bench.violation_count() == 0); });
}

TEST_CASE("Counts lost on the way are corrected when the cylinder passes the end switch") {
  Listener listener{/*with_devices=*/true};
  std::atomic<double> target_mm = 5.0;
  double place_mm = 5.0;
  double last_s = 0.0;
  BenchOptions options = HilOptions("HIL-1");
  options.reference_switch_mm = 0.0;
  options.contact_bounce_us = 3000;
  UmockdevBench device(Image(), options, [&](double time_s) {
    const double most_mm = 200.0 * std::max(0.0, time_s - last_s);
    place_mm += std::clamp(target_mm - place_mm, -most_mm, most_mm);
    last_s = std::max(last_s, time_s);
    HandState hand;
    hand.insertion_mm = place_mm;
    return hand;
  });
  const auto daemon = UsbDaemon({"--uncalibrated"});
  REQUIRE(listener.UntilCommands(10));
  const auto inserted_mm = [&] { return listener.commands.back().insertion_mm; };
  const auto move_to = [&](double mm) {
    target_mm = mm;
    REQUIRE(listener.Until([&] {
      bool there = false;
      device.Do([&](BenchDevice&, UsbHost&) { there = place_mm == mm; });
      return there;
    }));
    REQUIRE(listener.UntilCommands(listener.commands.size() + 10));
  };
  move_to(-1);
  REQUIRE(listener.UntilHealth("running", "the end switch closed; from now on"));
  move_to(30);
  REQUIRE(listener.Until([&] { return std::abs(inserted_mm() - 25.0) < 0.1; }));
  device.Do([](BenchDevice& bench, UsbHost&) {
    bench.sensor().SetFault(torquer::emulator::VirtualPmw3360::Fault::kSilent);
  });
  move_to(50);
  device.Do([](BenchDevice& bench, UsbHost&) {
    bench.sensor().SetFault(torquer::emulator::VirtualPmw3360::Fault::kNone);
  });
  REQUIRE(listener.Until([&] { return (listener.commands.back().flags & ~1) == 0; }));
  CHECK(inserted_mm() == Approx(25.0).margin(0.5));
  move_to(-1);
  REQUIRE(listener.UntilHealth("running", "of pushing were lost; the instrument now catches up"));
  REQUIRE(listener.Until([&] { return std::abs(inserted_mm() + 6.0) < 0.3; }));
  CHECK(listener.counters["marks_passed"] == 2);
}
