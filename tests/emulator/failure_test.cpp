// Failures on a bench: the sensor fails, the power is lost, the firmware restarts.
#include <algorithm>
#include <cmath>
#include <set>

#include "protocol/eeprom_layout.h"
#include "tests/support/emulated_bench.h"
#include "tests/support/paths.h"

namespace torquer::emulator {
namespace {

constexpr int kSettingsBytes = 10;

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
  // Runs until the fault is detected: at once if the sensor is silent, at the next check if
  // exchanged.
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

TEST_CASE("a silent sensor is flagged and started again, and the count continues") {
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

TEST_CASE("settings that were taken outlive a restart that follows at once") {
  for (const int frames : {0, 5, 20, 50, 90}) {
    CAPTURE(frames);
    Bench bench;
    bench.Start();
    for (const int cpi : {1600, 800, 1600, 1200, 2400}) {
      REQUIRE(bench.Configure(cpi, 10) == TransferStatus::kDone);
    }
    bench.Run(frames * 1e-3);
    REQUIRE(bench.Command(protocol::kCommandReset) == TransferStatus::kDone);
    bench.Run(0.3);
    bench.Start();
    bench.Run(0.3);
    CHECK(bench.last.cpi == 2400);
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

// EEPROM in which every byte of both copies differs from the data to be written.
std::vector<std::uint8_t> EepromBeforeTheCut() {
  Bench bench;
  bench.Start();
  REQUIRE(bench.Configure(300, 1) == TransferStatus::kDone);
  bench.Run(0.2);
  REQUIRE(bench.Configure(700, 33) == TransferStatus::kDone);
  bench.Run(0.2);
  std::vector<std::uint8_t> eeprom = bench.device.Eeprom();
  // The older copy will be overwritten.
  std::fill_n(eeprom.begin() + protocol::kEepromSettingsAddress[0], kSettingsBytes, 0x55);
  return eeprom;
}

// Starts the change and cuts the power during byte number `write`, after `share` of that byte's
// write time. Returns the byte's place in the copy; -1 if fewer bytes were written.
int CutDuring(Bench* bench, int write, double share) {
  constexpr double kByteUs = 3400;
  const int before = bench->device.chip().eeprom_writes();
  REQUIRE(bench->Configure(11900, 477) == TransferStatus::kDone);
  int cell = -1;
  for (int i = 0; i < 100 && cell < 0; ++i) {
    const Atmega32u4& chip = bench->device.chip();
    if (chip.eeprom_writes() - before == write + 1) cell = chip.EepromCellBeingWritten();
    if (cell < 0) bench->host.RunFrame();
  }
  if (cell >= 0) bench->device.RunUntil(bench->device.now_us() + share * (kByteUs - 1000));
  bench->device.PowerOff();
  return cell < 0 ? -1 : cell - protocol::kEepromSettingsAddress[0];
}

TEST_CASE("power cut in every byte of a change of the settings leaves the old or the new ones") {
  const std::vector<std::uint8_t> eeprom = EepromBeforeTheCut();
  std::set<int> torn;
  int old_ones = 0, new_ones = 0, writes = 0;
  for (bool all = false; !all;) {
    for (const double share : {0.0, 0.5, 1.0}) {
      BenchOptions options;
      options.eeprom = eeprom;
      options.seed = static_cast<std::uint32_t>(1 + writes * 3 + share * 2);
      Bench bench(options);
      bench.Start();
      const int byte = CutDuring(&bench, writes, share);
      all = byte < 0;
      torn.insert(byte);
      bench.host.RunFrame();
      bench.device.PowerOn();
      bench.Start();
      const auto kept = bench.Get<protocol::ConfigurationReport>(protocol::kConfigurationReportId);
      const bool is_old = kept.cpi == 700 && kept.joystick_deadzone == 33;
      const bool is_new = kept.cpi == 11900 && kept.joystick_deadzone == 477;
      CHECK((is_old || is_new));
      CHECK(is_new >= all);
      (is_old ? old_ones : new_ones) += 1;
      CHECK((bench.Get<protocol::IdentityReport>(protocol::kIdentityReportId).self_test & 2) != 0);
    }
    ++writes;
  }
  // Write order: the marker, every byte behind it, the marker again.
  CHECK(writes - 1 == kSettingsBytes + 1);
  for (int byte = 0; byte < kSettingsBytes; ++byte) CHECK(torn.count(byte) == 1);
  CHECK(old_ones > 3 * kSettingsBytes);
  CHECK(new_ones >= 3);
}

TEST_CASE("settings written twice are stored once") {
  Bench bench;
  bench.Start();
  REQUIRE(bench.Configure(800, 99) == TransferStatus::kDone);
  bench.Run(0.2);
  const int writes = bench.device.chip().eeprom_writes();
  for (int i = 0; i < 5; ++i) REQUIRE(bench.Configure(800, 99) == TransferStatus::kDone);
  bench.Run(0.2);
  CHECK(bench.device.chip().eeprom_writes() == writes);
}

TEST_CASE("a dip of the supply is reported as a brown-out, with its losses") {
  Bench bench;
  bench.device.SetHand(Slowly);
  bench.Start();
  REQUIRE(bench.Configure(800, 99) == TransferStatus::kDone);
  bench.Run(0.2);
  const std::uint8_t before = bench.last.boot_id;
  REQUIRE(bench.Configure(900, 98) == TransferStatus::kDone);
  bench.Run(0.01);  // EEPROM write in progress
  bench.device.chip().ResetByBrownOut();
  bench.Run(0.01);
  CHECK_FALSE(bench.host.ready());
  bench.Start();
  CHECK(bench.Diagnostics().reset_reason == 4);
  CHECK(bench.last.boot_id != before);
  CHECK(bench.last.cpi == 800);
  bench.CheckRules();
}

// While the firmware waits for a part of the chip, it must not kick the watchdog.
TEST_CASE("a part of the chip that never answers is ended by the watchdog, which is reported") {
  using Peripheral = Atmega32u4::Peripheral;
  for (const FirmwareImage& image : {Image16(), Image8()}) {
    for (const Peripheral peripheral : {Peripheral::kSpi, Peripheral::kAdc}) {
      INFO(static_cast<int>(peripheral));
      Bench bench({}, image);
      bench.Start();
      bench.device.chip().SetDead(peripheral);
      for (int i = 0; i < 1000 && bench.device.chip().resets() < 2; ++i) bench.host.RunFrame();
      CHECK(bench.device.chip().resets() >= 2);
      bench.device.chip().SetDead(Peripheral::kNone);
      bench.Run(0.3);
      bench.Start();
      CHECK(bench.Diagnostics().reset_reason == 8);
    }
  }
}

TEST_CASE("an EEPROM that is never ready blocks no other work") {
  Bench bench;
  bench.Start();
  bench.device.chip().SetDead(Atmega32u4::Peripheral::kEeprom);
  REQUIRE(bench.Configure(800, 99) == TransferStatus::kDone);
  bench.Run(1);
  CHECK(bench.last.cpi == 800);
  CHECK(bench.gaps == 0);
  CHECK(bench.device.chip().resets() == 0);
}

TEST_CASE("images and options that cannot be used are refused by name") {
  CHECK_THROWS_WITH(FirmwareImage("/nonexistent.elf"), Catch::Contains("/nonexistent.elf"));
  CHECK_THROWS_WITH(FirmwareImage(torquer::test::SourcePath("/LICENSE")),
                    Catch::Contains("not an ELF"));
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
