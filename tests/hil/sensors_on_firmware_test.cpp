// Sensors of a box, from the firmware to the daemon: another part, and two of them.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "calibration/calibration_file.h"
#include "host/device/report_copy.h"
#include "host/device/socket_source.h"
#include "host/device/source_reports.h"
#include "host/emulator/umockdev_front.h"
#include "protocol/hid_reports.h"
#include "tests/hil/usb_daemon.h"
#include "tests/support/daemon_process.h"
#include "tests/support/paths.h"

namespace {

using namespace torquer::hil;
using torquer::calibration::Calibration;
using torquer::emulator::BenchDevice;
using torquer::emulator::SensorKind;
using torquer::emulator::UmockdevBench;
using torquer::emulator::UsbHost;
using torquer::test::Listener;

// Keeps a calibration where the daemon finds it by the serial number.
void Keep(const Calibration& calibration) {
  const std::string path = torquer::calibration::CalibrationPath(calibration.device);
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  torquer::calibration::WriteCalibration(calibration, path);
}

}  // namespace

TEST_CASE("A calibration taken with another sensor is refused, also when the sensor is exchanged") {
  Listener listener{/*with_devices=*/true};
  BenchOptions options = HilOptions("HIL-1");
  const bool exchanged = GENERATE(false, true);
  if (!exchanged) options.sensor_kind = SensorKind::kPmw3389;
  UmockdevBench device(Image(), options, [](double) { return HandState{}; });
  Calibration calibration = torquer::calibration::NominalCalibration("HIL-1", 1200);
  calibration.sensor_product_id = 0x42;
  const std::string path = listener.folder.Path("calibration.toml");
  torquer::calibration::WriteCalibration(calibration, path);
  const auto daemon = UsbDaemon({"--device", "HIL-1", "--calibration", path});
  if (!exchanged) {
    CHECK(daemon->Wait() == 2);
    CHECK(daemon->Error().find("sensor = 0x42, but the device's sensor is 0x47 now") !=
          std::string::npos);
    CHECK(std::none_of(listener.commands.begin(), listener.commands.end(),
                       [](const auto& command) { return command.insertion_mm != 0; }));
    return;
  }
  REQUIRE(listener.UntilCommands(10));
  // While the device is unplugged, the sensor is exchanged. It does not answer when the device is
  // connected again.
  device.Do([](BenchDevice& bench, UsbHost&) { bench.sensor().SetKind(SensorKind::kPmw3389); });
  device.Unplug();
  REQUIRE(listener.UntilHealth("waiting for device", "was unplugged"));
  device.Plug();
  REQUIRE(listener.UntilHealth("waiting for device", "the device's sensor is 0x47 now"));
}

TEST_CASE("The emulator's options give another sensor and supply, and the daemon sees both") {
  Listener listener{/*with_devices=*/true};
  const std::string socket = listener.folder.Path("device");
  const ChildProcess emulator({torquer::test::ProgramPath("torquer-emulator"), "--serial", "HIL-1",
                               "--sensor", "pmw3389", "--supply-mv", "3300", "--socket", socket,
                               "--lcm-url", "none", "--duration", "60"});
  Calibration calibration = torquer::calibration::NominalCalibration("HIL-1", 1200);
  calibration.sensor_product_id = 0x42;
  const std::string path = listener.folder.Path("calibration.toml");
  torquer::calibration::WriteCalibration(calibration, path);
  ChildProcess refused(torquer::test::SocketWords(socket, {"--calibration", path}));
  CHECK(refused.Wait() == 2);
  CHECK(refused.Error().find("the device's sensor is 0x47 now") != std::string::npos);

  torquer::device::SocketSource source(socket);
  int supply_mv = 0;
  REQUIRE(listener.Until([&] {
    source.Wait(20, [](const torquer::device::SourceEvent&) {});
    try {
      torquer::device::SourceReports reports(source);
      supply_mv = torquer::device::GetReport<torquer::protocol::DiagnosticsReport>(
                      reports, torquer::protocol::kDiagnosticsReportId)
                      .supply_mv;
    } catch (const std::runtime_error&) {  // not connected yet
    }
    return supply_mv != 0;
  }));
  CHECK(supply_mv == Approx(3300).margin(40));
}

TEST_CASE("One box with two sensors drives two instruments, each by its own calibration") {
  Listener listener{/*with_devices=*/true};
  Calibration wire = torquer::calibration::NominalCalibration("HIL-1", 1200);
  Calibration catheter = torquer::calibration::NominalCalibration("HIL-1.2", 1200);
  catheter.motion.per_count[0][0] *= 2;
  Keep(wire);
  Keep(catheter);
  PushingHand hand, catheter_hand;
  UmockdevBench device(
      FirmwareImage(torquer::test::FirmwarePath("torquer-firmware-two-sensors.elf")),
      HilOptions("HIL-1"), [&](double time_s) {
        HandState both = hand(time_s);
        const HandState second = catheter_hand(time_s);
        both.catheter_insertion_mm = second.insertion_mm;
        both.catheter_rotation_rad = second.rotation_rad;
        return both;
      });
  const auto daemon = UsbDaemon({"--device", "HIL-1", "--second-instrument", "catheter"});
  REQUIRE(daemon->WaitForError("running: reading device HIL-1 at"));
  REQUIRE(daemon->WaitForError("running: reading device HIL-1.2 at"));
  const auto inserted_mm = [&](const std::string& instrument) {
    for (auto it = listener.commands.rbegin(); it != listener.commands.rend(); ++it) {
      if (it->instrument == instrument) return it->insertion_mm;
    }
    return -1.0;
  };
  const auto until_at = [&](const std::string& instrument, double mm) {
    return listener.Until([&] {
      listener.samples.clear();
      return std::abs(inserted_mm(instrument) - mm) < 4 * kMmPerCount;
    });
  };
  REQUIRE(until_at("guidewire", 0));
  REQUIRE(until_at("catheter", 0));
  catheter_hand.Push();
  REQUIRE(until_at("catheter", 200));
  CHECK(inserted_mm("guidewire") == 0.0);
  hand.Push();
  REQUIRE(until_at("guidewire", 100));
  CHECK(std::abs(inserted_mm("catheter") - 200) < 4 * kMmPerCount);

  device.Unplug();
  REQUIRE(listener.UntilHealth("waiting for device", "was unplugged"));
  device.Plug();
  REQUIRE(daemon->WaitForError("device HIL-1 is connected again"));
  REQUIRE(daemon->WaitForError("device HIL-1.2 is connected again"));
  listener.Forget();
  REQUIRE(until_at("catheter", 200));
  CHECK(listener.counters["reports_wrong_id"] == 0);
  device.Do([](BenchDevice& bench, UsbHost&) { CHECK(bench.violation_count() == 0); });
}

TEST_CASE("One and two sensors, in box and daemon, give a sentence and never a wrong motion") {
  Listener listener{/*with_devices=*/true};
  const bool two = GENERATE(false, true);
  PushingHand hand;
  UmockdevBench device(FirmwareImage(torquer::test::FirmwarePath(
                           two ? "torquer-firmware-two-sensors.elf" : "torquer-firmware.elf")),
                       HilOptions("HIL-1"), [&](double time_s) {
                         HandState state = hand(time_s);
                         state.catheter_insertion_mm = -state.insertion_mm;
                         return state;
                       });
  if (!two) {
    for (const std::vector<std::string>& words :
         {std::vector<std::string>{"--second-instrument", "catheter"}, {"--sensor", "2"}}) {
      std::vector<std::string> all{"--uncalibrated"};
      all.insert(all.end(), words.begin(), words.end());
      const auto daemon = UsbDaemon(all);
      CHECK(daemon->Wait() == 2);
      CHECK(daemon->Error().find("the device 'HIL-1' has one sensor") != std::string::npos);
    }
    return;
  }
  SECTION("a daemon of one instrument reads the first sensor, and says that there is another") {
    const auto daemon = UsbDaemon({"--uncalibrated"});
    REQUIRE(daemon->WaitForError("its second sensor drives no instrument here"));
    hand.Push();
    REQUIRE(listener.Until(
        [&] { return !listener.commands.empty() && listener.commands.back().insertion_mm > 99; }));
    for (const auto& command : listener.commands) CHECK(command.insertion_mm >= 0);
  }
  SECTION("another resolution of the second calibration is refused") {
    Keep(torquer::calibration::NominalCalibration("HIL-1", 1600));
    Keep(torquer::calibration::NominalCalibration("HIL-1.2", 1200));
    const auto daemon = UsbDaemon({"--second-instrument", "catheter"});
    CHECK(daemon->Wait() == 2);
    CHECK(daemon->Error().find("motion.cpi = 1200, but the device's sensor is set to 1600") !=
          std::string::npos);
  }
}
