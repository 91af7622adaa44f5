// What goes wrong on a bench: the sensor fails, the power goes, the firmware restarts.
#include <algorithm>
#include <cmath>

#include "protocol/eeprom_layout.h"
#include "tests/emulator/bench.h"

namespace torquer::emulator {
namespace {

HandState Slowly(double time_s) {
  HandState hand;
  hand.insertion_mm = 20 * time_s;
  return hand;
}

void Fail(VirtualPmw3360::Fault fault) {
  Bench bench;
  bench.device.SetHand(Slowly);
  bench.Start();
  bench.Run(1);
  bench.device.sensor().SetFault(fault);
  // Until it is noticed: at once if it falls silent, at the next check if it is exchanged.
  for (int i = 0; i < 1000 && !(bench.last.flags & protocol::kFlagSensorFault); ++i) {
    bench.host.RunFrame();
  }
  REQUIRE((bench.last.flags & protocol::kFlagSensorFault) != 0);
  const std::int32_t held = bench.last.axial_counts;
  bench.Run(1);
  CHECK((bench.last.flags & protocol::kFlagSensorFault) != 0);
  CHECK(bench.last.axial_counts == held);
  CHECK(held > 900);
  bench.device.sensor().SetFault(VirtualPmw3360::Fault::kNone);
  for (int i = 0; i < 3000 && (bench.last.flags & protocol::kFlagSensorFault); ++i) {
    bench.host.RunFrame();
  }
  REQUIRE_FALSE(bench.last.flags & protocol::kFlagSensorFault);
  CHECK(bench.last.axial_counts >= held);
  CHECK(bench.last.axial_counts < held + 10);
  const std::int32_t recovered = bench.last.axial_counts;
  bench.Run(1);
  CHECK(bench.last.axial_counts == Approx(recovered + 945).margin(3));
  CHECK(bench.last.cpi == 1200);
  CHECK(bench.gaps == 0);
  CHECK(bench.Diagnostics().sensor_faults > 0);
  bench.CheckRules();
}

TEST_CASE("a sensor that falls silent is flagged, started again, and the count goes on") {
  Fail(VirtualPmw3360::Fault::kSilent);
}
TEST_CASE("the same for a data line shorted to ground") { Fail(VirtualPmw3360::Fault::kShorted); }
TEST_CASE("the same for a sensor that answers as another") {
  Fail(VirtualPmw3360::Fault::kForeign);
}

TEST_CASE("a dip of the sensor's supply is found and its resolution set again") {
  Bench bench;
  bench.device.SetHand(Slowly);
  bench.Start();
  REQUIRE(bench.Configure(2400, 10) == TransferStatus::kDone);
  bench.Run(0.5);
  bench.device.sensor().PowerUp(bench.device.chip().now_us() - 60000);
  CHECK(bench.device.sensor().cpi() == 5000);
  bench.Run(2);
  CHECK(bench.device.sensor().cpi() == 2400);
  CHECK_FALSE(bench.last.flags & protocol::kFlagSensorFault);
  CHECK(bench.gaps == 0);
}

TEST_CASE(
    "a restart is seen: another boot id, the watchdog as its reason, the device back on the bus") {
  for (const protocol::Command command :
       {protocol::kCommandReset, protocol::kCommandEnterBootloader}) {
    Bench bench;
    bench.device.SetHand(Slowly);
    int gone = 0;
    bench.host.on_gone = [&gone] { ++gone; };
    bench.Start();
    bench.Run(0.5);
    const protocol::InputReport before = bench.last;
    REQUIRE(bench.Command(command) == TransferStatus::kDone);
    bench.Run(0.1);
    CHECK(gone == 1);
    bench.Start();
    CHECK(bench.last.boot_id != before.boot_id);
    CHECK(bench.last.device_time_us < before.device_time_us);
    CHECK(bench.last.axial_counts < before.axial_counts);
    CHECK(bench.Diagnostics().reset_reason == 8);
    CHECK(bench.device.chip().resets() == 1);
    bench.CheckRules();
  }
}

TEST_CASE("the reset button is seen too, with its own reason") {
  Bench bench;
  bench.Start();
  const std::uint8_t before = bench.last.boot_id;
  bench.device.ResetByPin();
  bench.Run(0.01);
  CHECK_FALSE(bench.host.ready());
  bench.Start();
  CHECK(bench.last.boot_id != before);
  CHECK(bench.last.buttons == 0);
  CHECK(bench.Diagnostics().reset_reason == 2);
}

TEST_CASE("pulled and plugged in again: another boot id, the settings kept") {
  Bench bench;
  bench.Start();
  REQUIRE(bench.Configure(800, 99) == TransferStatus::kDone);
  bench.Run(0.2);
  std::uint8_t last = bench.last.boot_id;
  for (int i = 0; i < 5; ++i) {
    bench.device.PowerOff();
    bench.Run(0.05);
    CHECK_FALSE(bench.host.ready());
    bench.device.PowerOn();
    bench.Start();
    CHECK(bench.last.boot_id != last);
    last = bench.last.boot_id;
    CHECK(bench.last.cpi == 800);
  }
  const protocol::DiagnosticsReport diagnostics = bench.Diagnostics();
  CHECK(diagnostics.reset_reason == 1);
  CHECK(diagnostics.settings_writes == 1);
  bench.CheckRules();
}

TEST_CASE("power cut anywhere in a change of the settings leaves the old or the new ones") {
  std::vector<std::uint8_t> eeprom;
  {
    Bench bench;
    bench.Start();
    REQUIRE(bench.Configure(700, 33) == TransferStatus::kDone);
    bench.Run(0.2);
    eeprom = bench.device.Eeprom();
  }
  int old_ones = 0, new_ones = 0, cells = 0;
  for (double cut_ms = 0; cut_ms < 45; cut_ms += 0.7) {
    BenchOptions options;
    options.eeprom = eeprom;
    options.seed = static_cast<std::uint32_t>(cut_ms * 10);
    Bench bench(options);
    bench.Start();
    const int written_before = bench.device.chip().eeprom_writes();
    REQUIRE(bench.Configure(11900, 477) == TransferStatus::kDone);
    bench.Run(std::floor(cut_ms) * 1e-3);
    bench.device.RunUntil(bench.device.now_us() + (cut_ms - std::floor(cut_ms)) * 1000);
    cells = std::max(cells, bench.device.chip().eeprom_writes() - written_before);
    bench.device.PowerOff();
    bench.host.RunFrame();
    bench.device.PowerOn();
    bench.Start();
    const auto kept = bench.Get<protocol::ConfigurationReport>(protocol::kConfigurationReportId);
    const bool is_old = kept.cpi == 700 && kept.joystick_deadzone == 33;
    const bool is_new = kept.cpi == 11900 && kept.joystick_deadzone == 477;
    CHECK((is_old || is_new));
    (is_old ? old_ones : new_ones) += 1;
    CHECK((bench.Get<protocol::IdentityReport>(protocol::kIdentityReportId).self_test & 2) != 0);
  }
  CHECK(old_ones > 10);
  CHECK(new_ones > 0);
  CHECK(cells >= 8);
}

TEST_CASE("settings written twice alike wear nothing") {
  Bench bench;
  bench.Start();
  REQUIRE(bench.Configure(800, 99) == TransferStatus::kDone);
  bench.Run(0.2);
  const int writes = bench.device.chip().eeprom_writes();
  for (int i = 0; i < 5; ++i) REQUIRE(bench.Configure(800, 99) == TransferStatus::kDone);
  bench.Run(0.2);
  CHECK(bench.device.chip().eeprom_writes() == writes);
}

TEST_CASE("images and options that cannot be used are refused by name") {
  CHECK_THROWS_WITH(FirmwareImage("/nonexistent.elf"), Catch::Contains("/nonexistent.elf"));
  CHECK_THROWS_WITH(FirmwareImage(TORQUER_SOURCE_DIR "/LICENSE"), Catch::Contains("not an ELF"));
  CHECK_THROWS_WITH(FirmwareImage("/proc/self/exe"), Catch::Contains("not an ELF file for AVR"));
  BenchOptions options;
  options.serial = "twenty characters ..";
  CHECK_THROWS_WITH(BenchDevice(Image16(), options), Catch::Contains("twenty characters"));
  options = {};
  options.cylinder_radius_mm = 0;
  CHECK_THROWS_WITH(BenchDevice(Image16(), options), Catch::Contains("--cylinder-radius-mm"));
}

}  // namespace
}  // namespace torquer::emulator
