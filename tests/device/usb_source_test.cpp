// The daemon on unmodified libusb, with scripted devices in a mocked kernel.

#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>

#include "calibration/calibration_file.h"
#include "protocol/usb_ids.h"
#include "tests/device/usb_chain.h"
#include "tests/support/paths.h"

namespace {

using namespace torquer::test;
using torquer_lcm::instrument_command_t;

std::string RefusalOf(UsbChain& chain, const std::vector<std::string>& more = {}) {
  const auto daemon = chain.Start(more);
  CHECK(daemon->Wait() == 2);
  return daemon->Error();
}

}  // namespace

TEST_CASE("USB reports become commands; SIGTERM releases the device") {
  UsbChain chain;
  chain.testbed.Plug(kAddress, Bench());
  const auto daemon = chain.Start();
  REQUIRE(daemon->WaitForError("reading device BENCH-7 at USB bus 1 device 5"));
  CHECK(chain.testbed.Claimed(kAddress));
  const instrument_command_t command = chain.Push(kAddress, 500, 4);
  CHECK(command.insertion_mm == Approx(499 * 4 * kMmPerCount));
  CHECK(command.sequence >= 499);
  CHECK(chain.listener.samples.back().device == "BENCH-7");
  daemon->Signal(SIGTERM);
  CHECK(daemon->Wait() == 0);
  CHECK(chain.listener.UntilHealth("stopping", "asked to stop"));
  CHECK(chain.listener.counters["reports_lost"] == 0);
  CHECK_FALSE(chain.testbed.Claimed(kAddress));
  CHECK(chain.testbed.TransfersWaiting(kAddress) == 0);
}

TEST_CASE("Several transfers are in flight, so that no poll is missed") {
  UsbChain chain;
  const auto daemon = chain.Read();
  REQUIRE(chain.listener.Until([&] { return chain.testbed.TransfersWaiting(kAddress) == 4; }));
}

TEST_CASE("Short packets, overlong packets and transfer errors are counted and survived") {
  UsbChain chain;
  const auto daemon = chain.Read();
  const double before_mm = chain.Push(kAddress, 10, 10).insertion_mm;
  std::vector<std::uint8_t> bytes = Bytes(Next(chain.report));
  bytes.resize(20);
  chain.testbed.Input(kAddress, {InputStep::Kind::kData, bytes});
  bytes.resize(40);
  chain.testbed.Input(kAddress, {InputStep::Kind::kData, bytes});
  chain.testbed.Input(kAddress, {InputStep::Kind::kError});
  const instrument_command_t after = chain.Push(kAddress, 10, 10);
  CHECK(after.insertion_mm == Approx(before_mm + 100 * kMmPerCount));
  REQUIRE(chain.listener.Until([&] { return chain.listener.counters["reports_received"] == 22; }));
  CHECK(chain.listener.counters["reports_wrong_length"] == 2);
  CHECK(chain.listener.counters["reports_lost"] == 0);
}

TEST_CASE("A stalled endpoint is cleared and read on") {
  UsbChain chain;
  const auto daemon = chain.Read();
  const double before_mm = chain.Push(kAddress, 10, 10).insertion_mm;
  chain.testbed.Input(kAddress, {InputStep::Kind::kStall});
  CHECK(chain.Push(kAddress, 10, 10).insertion_mm == Approx(before_mm + 100 * kMmPerCount));
  CHECK(chain.testbed.ClearedHalts(kAddress) == 1);
}

TEST_CASE("A device unplugged with transfers in flight is waited for and read on") {
  // The kernel may end the transfers, send udev's event, or both.
  UsbChain chain;
  const auto daemon = chain.Read();
  double before_mm = chain.Push(kAddress, 10, 10).insertion_mm;
  for (int round = 0; round < 3; ++round) {
    chain.listener.Forget();
    chain.testbed.Unplug(kAddress + round);
    REQUIRE(chain.listener.UntilHealth("waiting for device", "was unplugged; holding"));
    REQUIRE(chain.listener.UntilHolds(2));
    CHECK(chain.listener.holds.back().insertion_mm == before_mm);

    chain.testbed.Plug(kAddress + round + 1, Bench());
    REQUIRE(chain.listener.UntilHealth("running", "device BENCH-7 is connected again"));
    chain.report = StillReport();
    chain.report.boot_id = static_cast<std::uint8_t>(50 + round);
    const instrument_command_t after = chain.Push(kAddress + round + 1, 10, 10);
    CHECK(after.insertion_mm == Approx(before_mm + 90 * kMmPerCount));
    before_mm = after.insertion_mm;
  }
  CHECK(chain.listener.counters["reports_lost"] == 0);
  daemon->Signal(SIGINT);
  CHECK(daemon->Wait() == 0);
}

TEST_CASE("A device unplugged without a word is noticed by its transfers") {
  UsbChain chain;
  const auto daemon = chain.Read();
  chain.Push(kAddress, 10, 10);
  chain.testbed.Unplug(kAddress, /*announce=*/false);
  REQUIRE(chain.listener.UntilHealth("waiting for device", "was unplugged"));
}

TEST_CASE("A device plugged in after the start is found") {
  UsbChain chain;
  const auto daemon = chain.Start();
  REQUIRE(daemon->WaitForError("waiting for USB (1209:0001)"));
  chain.testbed.Plug(kAddress, Bench());
  REQUIRE(daemon->WaitForError("reading device BENCH-7"));
  CHECK(chain.Push(kAddress, 10, 10).insertion_mm == Approx(90 * kMmPerCount));
}

TEST_CASE("A device that fails at first, as just plugged in, is tried again") {
  UsbChain chain;
  UsbDeviceScript slow = Bench();
  slow.stalled_strings = 5;
  chain.testbed.Plug(kAddress, slow);
  const auto daemon = chain.Start();
  REQUIRE(daemon->WaitForError("reading device BENCH-7"));
}

TEST_CASE("Among several devices the serial number chooses") {
  UsbChain chain;
  chain.testbed.Plug(kAddress, Bench("LEFT-1"));
  chain.testbed.Plug(kAddress + 1, Bench("RIGHT-2"));
  SECTION("without a serial number no device is chosen") {
    const std::string refusal = RefusalOf(chain);
    CHECK(refusal.find("several bench devices are plugged in:") != std::string::npos);
    CHECK(refusal.find("LEFT-1") != std::string::npos);
    CHECK(refusal.find("RIGHT-2") != std::string::npos);
    CHECK(refusal.find("--device") != std::string::npos);
  }
  SECTION("the selected device is read, and no other one") {
    const auto daemon = chain.Start({"--device", "RIGHT-2"});
    REQUIRE(daemon->WaitForError("reading device RIGHT-2 at USB bus 1 device 6"));
    chain.Push(kAddress + 1, 10, 10);
    chain.testbed.Unplug(kAddress + 1);
    REQUIRE(chain.listener.UntilHealth("waiting for device", "was unplugged"));
    chain.testbed.Plug(kAddress + 2, Bench("THIRD-3"));
    chain.testbed.Plug(kAddress + 3, Bench("RIGHT-2"));
    REQUIRE(daemon->WaitForError("device RIGHT-2 is connected again"));
    CHECK_FALSE(chain.testbed.Claimed(kAddress + 2));
  }
}

TEST_CASE("Other people's devices with the same test ids are left alone") {
  UsbChain chain;
  UsbDeviceScript other = Bench();
  other.product = "Coffee machine";
  chain.testbed.Plug(kAddress, other);
  CHECK(RefusalOf(chain).find("no device: none found at USB (1209:0001)") != std::string::npos);
  CHECK_FALSE(chain.testbed.Claimed(kAddress));
}

TEST_CASE("Firmware on the USB that does not fit is refused with the command that remedies it") {
  UsbChain chain;
  UsbDeviceScript script = Bench();
  std::string expected;
  SECTION("another protocol version") {
    const auto healthy = script.control;
    script.control = [healthy](const ControlRequest& request) {
      ControlAnswer answer = healthy(request);
      if (request.value == 0x0302) answer.data[1] = 3;
      return answer;
    };
    expected = "firmware has protocol version 3, this program has 1";
  }
  SECTION("a stalled identity") {
    script.control = [](const ControlRequest&) {
      return ControlAnswer{ControlAnswer::Kind::kStall};
    };
    expected = "does not report its firmware version (the device refused the request)";
  }
  SECTION("an identity that never comes") {
    script.control = [](const ControlRequest&) {
      return ControlAnswer{ControlAnswer::Kind::kSilence};
    };
    expected = "does not report its firmware version (the device did not answer within a second)";
  }
  SECTION("an identity cut short") {
    const auto healthy = script.control;
    script.control = [healthy](const ControlRequest& request) {
      ControlAnswer answer = healthy(request);
      answer.data.resize(12);
      return answer;
    };
    expected = "identity has 12 bytes instead of 32";
  }
  SECTION("another endpoint") {
    script.input_packet_bytes = 8;
    expected = "no input endpoint for reports of 32 bytes";
  }
  chain.testbed.Plug(kAddress, script);
  const std::string refusal = RefusalOf(chain);
  CAPTURE(refusal);
  CHECK(refusal.find(expected) != std::string::npos);
  CHECK(refusal.find("torquer-flash") != std::string::npos);
}

TEST_CASE("A device in its bootloader is distinguished from a missing one") {
  UsbChain chain;
  UsbDeviceScript script = Bench();
  script.product_id = torquer::protocol::kUsbBootloaderProductId;
  chain.testbed.Plug(kAddress, script);
  const std::string refusal = RefusalOf(chain);
  CAPTURE(refusal);
  CHECK(refusal.find("a device waits in its bootloader") != std::string::npos);
  CHECK(refusal.find("torquer-flash") != std::string::npos);
}

TEST_CASE("Without permission the udev rule is named") {
  UsbChain chain;
  chain.testbed.Plug(kAddress, Bench());
  namespace fs = std::filesystem;
  fs::permissions(fs::path(chain.testbed.Root()) / "dev/bus/usb/001/005", fs::perms::none);
  // Drops all capabilities: root, even if only in the namespace, would get access anyway.
  const std::vector<std::string> words{"/usr/bin/setpriv", "--bounding-set=-all",
                                       "--inh-caps=-all",  torquer::test::kDaemonProgram,
                                       "--source",         "usb",
                                       "--uncalibrated"};
  ChildProcess daemon(words);
  const int status = daemon.Wait();
  CAPTURE(daemon.Error());
  CHECK(status == 2);
  CHECK(daemon.Error().find("may not be opened by this user") != std::string::npos);
  CHECK(daemon.Error().find("hardware/udev/70-torquer.rules") != std::string::npos);
  CHECK(fs::exists(torquer::test::SourcePath("/hardware/udev/70-torquer.rules")));
}

TEST_CASE("The option --list shows every bench device and claims none") {
  UsbChain chain;
  const std::string folder = chain.listener.folder.Path("config");
  setenv("XDG_CONFIG_HOME", folder.c_str(), 1);
  std::filesystem::create_directories(folder + "/torquer");
  using torquer::calibration::NominalCalibration;
  torquer::calibration::WriteCalibration(NominalCalibration("LEFT-1", 1200),
                                         folder + "/torquer/LEFT-1.toml");
  // Calibration of another device under the wrong name.
  torquer::calibration::WriteCalibration(NominalCalibration("LEFT-1", 1200),
                                         folder + "/torquer/THIRD-3.toml");
  const auto list = [] {
    ChildProcess program({torquer::test::kDaemonProgram, "--list"});
    CHECK(program.Wait() == 0);
    CHECK(program.Error().empty());
    return program.Output();
  };
  CHECK(list().find("none is plugged in") != std::string::npos);

  chain.testbed.Plug(kAddress, Bench("LEFT-1"));
  chain.testbed.Plug(kAddress + 1, Bench("RIGHT-2"));
  chain.testbed.Plug(kAddress + 2, Bench("THIRD-3"));
  UsbDeviceScript waiting = Bench("FOURTH-4");
  waiting.product_id = torquer::protocol::kUsbBootloaderProductId;
  chain.testbed.Plug(kAddress + 3, waiting);
  UsbDeviceScript other = Bench("COFFEE-5");
  other.manufacturer = "Another maker";
  chain.testbed.Plug(kAddress + 4, other);
  const std::string text = list();
  CAPTURE(text);
  const auto line = [&text](const std::string& serial) {
    const std::size_t at = text.find("  " + serial + "  ");
    return at == std::string::npos ? "" : text.substr(at, text.find('\n', at) - at);
  };
  CHECK(line("LEFT-1").find("/dev/bus/usb/001/005  calibrated by " + folder +
                            "/torquer/LEFT-1.toml") != std::string::npos);
  CHECK(line("LEFT-1").find("firmware ") != std::string::npos);
  CHECK(line("LEFT-1").find("read by") == std::string::npos);
  CHECK(line("RIGHT-2").find("not calibrated") != std::string::npos);
  CHECK(line("THIRD-3").find("calibration refused: ") != std::string::npos);
  CHECK(line("FOURTH-4").find("in its bootloader") != std::string::npos);
  CHECK(text.find("COFFEE-5") == std::string::npos);
  for (int i = 0; i < 4; ++i) CHECK_FALSE(chain.testbed.Claimed(kAddress + i));
  unsetenv("XDG_CONFIG_HOME");
}
