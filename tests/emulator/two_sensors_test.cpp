// A box with two sensors: the firmware of board 2 in the emulator.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>

#include "host/emulator/bench_device.h"
#include "host/emulator/motion_script.h"
#include "host/emulator/usb_host.h"
#include "host/support/error.h"
#include "protocol/hid_reports.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace torquer::emulator {
namespace {

using protocol::kInputReportId;
using protocol::kSecondInputReportId;

struct TwoSensorBox {
  explicit TwoSensorBox(const std::string& clock = "", const BenchOptions& options = {})
      : device(FirmwareImage(test::FirmwarePath("torquer-firmware-two-sensors" + clock + ".elf")),
               options),
        host(device) {
    host.wants_input = [] { return true; };
    host.on_input = [this](const std::vector<std::uint8_t>& packet) {
      protocol::InputReport report;
      REQUIRE(packet.size() == sizeof report);
      std::memcpy(&report, packet.data(), sizeof report);
      last[report.report_id] = report;
      ++reports[report.report_id];
    };
    REQUIRE(host.RunUntilReady());
    Run(0.3);
    REQUIRE(Fault(kInputReportId) == 0);
    REQUIRE(Fault(kSecondInputReportId) == 0);
  }
  ~TwoSensorBox() {
    for (const std::string& violation : device.Violations()) FAIL_CHECK(violation);
  }
  TwoSensorBox(const TwoSensorBox&) = delete;
  TwoSensorBox& operator=(const TwoSensorBox&) = delete;

  void Run(double seconds) {
    const double end_us = device.now_us() + seconds * 1e6;
    while (device.now_us() < end_us - 1) host.RunFrame();
  }
  int Fault(int id) { return last[id].flags & protocol::kFlagSensorFault; }

  BenchDevice device;
  UsbHost host;
  std::map<int, protocol::InputReport> last;
  std::map<int, int> reports;
};

HandState Crossing(double time_s) {
  HandState hand;
  hand.insertion_mm = 100 * time_s;
  hand.rotation_rad = time_s;
  hand.catheter_insertion_mm = -30 * time_s;
  hand.catheter_rotation_rad = -3 * time_s;
  return hand;
}

// Moves both cylinders until a time, so that the last reports hold all counts.
std::function<HandState(double)> CrossingUntil(double end_s) {
  return [end_s](double now_s) { return Crossing(std::min(now_s, end_s)); };
}

TEST_CASE("two sensors count two cylinders, each its own, 500 times a second") {
  TwoSensorBox box(GENERATE("", "-8mhz", "-16to8mhz"));
  const double from_s = box.device.now_us() * 1e-6;
  const double to_s = from_s + 1.9;
  box.device.SetHand(CrossingUntil(to_s));
  box.reports.clear();
  const auto before = box.last;
  box.Run(2.0);
  CHECK(box.reports[kInputReportId] == Approx(1000).margin(2));
  CHECK(box.reports[kSecondInputReportId] == Approx(1000).margin(2));
  const VirtualPmw3360& wire = box.device.sensor();
  const VirtualPmw3360& catheter = *box.device.second_sensor();
  CHECK(box.last[kInputReportId].axial_counts == wire.axial_counts());
  CHECK(box.last[kInputReportId].transverse_counts == wire.transverse_counts());
  CHECK(box.last[kSecondInputReportId].axial_counts == catheter.axial_counts());
  CHECK(box.last[kSecondInputReportId].transverse_counts == catheter.transverse_counts());
  const double counts = 1200 / 25.4;
  CHECK(wire.axial_counts() == Approx(100 * to_s * counts).margin(20));
  CHECK(catheter.axial_counts() == Approx(-30 * to_s * counts).margin(20));
  CHECK(catheter.transverse_counts() == Approx(-3 * 5 * to_s * counts).margin(20));
  CHECK(wire.stray_counts() + catheter.stray_counts() == 0);
  for (const int id : {kInputReportId, kSecondInputReportId}) {
    CHECK(static_cast<std::uint16_t>(box.last[id].sequence - before.at(id).sequence) ==
          box.reports[id]);
  }
}

TEST_CASE("one of two sensors may fail, and the other goes on") {
  const bool first_fails = GENERATE(false, true);
  TwoSensorBox box;
  box.device.SetHand(CrossingUntil(box.device.now_us() * 1e-6 + 4.0));
  VirtualPmw3360& failing = first_fails ? box.device.sensor() : *box.device.second_sensor();
  const VirtualPmw3360& other = first_fails ? *box.device.second_sensor() : box.device.sensor();
  const int failed = first_fails ? kInputReportId : kSecondInputReportId;
  const int sound = first_fails ? kSecondInputReportId : kInputReportId;
  SECTION("silent") {
    failing.SetFault(VirtualPmw3360::Fault::kSilent);
    box.Run(0.5);
    CHECK(box.Fault(failed) != 0);
    failing.SetFault(VirtualPmw3360::Fault::kNone);
  }
  SECTION("it resets itself") { failing.ResetItself(box.device.chip().now_us()); }
  box.Run(0.02);
  const int before = box.last[sound].axial_counts;
  CHECK(box.Fault(sound) == 0);
  box.Run(4.0);
  CHECK(std::abs(box.last[sound].axial_counts - before) > 1000);
  CHECK(box.last[sound].axial_counts == other.axial_counts());
  CHECK(box.Fault(failed) == 0);
  CHECK(box.Fault(sound) == 0);
}

TEST_CASE("both sensors sleep while the bus is suspended, and count on after it") {
  TwoSensorBox box;
  box.host.Suspend();
  box.Run(0.3);
  CHECK(box.device.PartsAwake().empty());
  box.host.Resume();
  box.Run(0.5);
  CHECK(box.Fault(kInputReportId) == 0);
  CHECK(box.Fault(kSecondInputReportId) == 0);
}

TEST_CASE("a motion file has columns for the catheter, or not") {
  const test::TemporaryFolder folder;
  const std::string path = folder.Path("motion.csv");
  std::ofstream(path) << "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons,"
                         "catheter_insertion_mm,catheter_rotation_rad\n"
                         "0,0,0,0,0,,0,0\n1,10,1,0,0,xray,20,-2\n";
  const HandState half = MotionScript::FromFile(path).At(0.5);
  CHECK(half.insertion_mm == Approx(5));
  CHECK(half.catheter_insertion_mm == Approx(10));
  CHECK(half.catheter_rotation_rad == Approx(-1));
  std::ofstream(path) << "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons,"
                         "catheter_insertion_mm\n0,0,0,0,0,,0\n";
  CHECK_THROWS_WITH(MotionScript::FromFile(path), Catch::Contains("it must be 'time_s,"));
}

}  // namespace
}  // namespace torquer::emulator
