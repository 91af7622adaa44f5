#include "firmware/src/bench_firmware.h"

#include <catch2/catch.hpp>
#include <cstring>

#include "firmware/board/board.h"
#include "firmware/src/pmw3360.h"
#include "firmware/src/sensor_service.h"
#include "firmware/src/usb_device.h"
#include "protocol/eeprom_layout.h"
#include "tests/firmware/fake_board.h"
#include "tests/support/reports.h"

namespace torquer::firmware {
namespace {

using test::CommandOf;
using test::ConfigurationOf;

/// The whole firmware, configured by a host that polls; the sensor moves one count per frame.
class Bench {
 public:
  Bench() {
    NewBoard().sensor = [this](std::uint8_t sent, bool first) { return Sensor(sent, first); };
  }

  void Start() {
    firmware.Start();
    board().setups.push_back({0x00, 9, 1, 0, 0, 0, 0, 0});
    firmware.Step();
  }
  protocol::InputReport Frame() {
    const std::uint32_t start_us = board().now_us;
    board().frame_start_us = start_us;
    firmware.Step();
    board().now_us = start_us + 1000;
    REQUIRE(board().inputs.size() == 1);
    protocol::InputReport report;
    std::memcpy(&report, board().inputs.front().data(), sizeof(report));
    board().inputs.pop_front();
    return report;
  }
  protocol::InputReport FrameUntilHealthy() {
    protocol::InputReport report = Frame();
    for (int i = 0; i < 3000 && (report.flags & protocol::kFlagSensorFault); ++i) report = Frame();
    REQUIRE_FALSE(report.flags & protocol::kFlagSensorFault);
    return report;
  }
  template <typename Report>
  Report Get(std::uint8_t id) {
    std::uint8_t bytes[ReportHandler::kCapacity];
    REQUIRE(firmware.GetFeatureReport(id, bytes) == sizeof(Report));
    Report report;
    std::memcpy(&report, bytes, sizeof(report));
    return report;
  }
  template <typename Report>
  bool Set(const Report& report) {
    return firmware.SetFeatureReport(reinterpret_cast<const std::uint8_t*>(&report),
                                     sizeof(report));
  }

  Pmw3360 sensor;
  SensorService sensor_reports{sensor};
  UsbDevice usb{firmware, sensor_reports};
  BenchFirmware firmware{sensor, sensor_reports, usb};
  bool sensor_dead = false;

 private:
  std::uint8_t Sensor(std::uint8_t sent, bool first) {
    if (sensor_dead) return 0xff;
    if (first) {
      address_ = sent;
      index_ = 0;
      return 0;
    }
    if (address_ & 0x80) {
      registers_[address_ & 0x7f] = sent;
      return 0;
    }
    if (address_ == 0x24) return 0x3f;
    if (address_ == 0x50) {
      // One count in distal direction, two right-handed.
      static constexpr std::uint8_t kBurst[12] = {0x80, 0x3f, 0xfe, 0xff, 1, 0,
                                                  50,   9,    90,   10,   0, 80};
      return kBurst[index_++];
    }
    if (address_ == 0x00) return 0x42;
    if (address_ == 0x3f) return 0xbd;
    return registers_[address_];
  }

  std::uint8_t registers_[128] = {};
  std::uint8_t address_ = 0;
  std::size_t index_ = 0;
};

TEST_CASE("a report is sent in every frame after configuration, for any state of the sensor") {
  Bench bench;
  bench.Start();
  std::uint16_t sequence = bench.Frame().sequence;
  for (int i = 0; i < 500; ++i) {
    if (i == 200) bench.sensor_dead = true;
    REQUIRE(bench.Frame().sequence == ++sequence);
  }
}

TEST_CASE("the count stays during a sensor fault and continues after it") {
  Bench bench;
  bench.Start();
  bench.FrameUntilHealthy();
  protocol::InputReport last{};
  for (int i = 0; i < 100; ++i) last = bench.Frame();
  bench.sensor_dead = true;
  for (int i = 0; i < 300; ++i) {
    const protocol::InputReport report = bench.Frame();
    REQUIRE((report.flags & protocol::kFlagSensorFault) != 0);
    REQUIRE(report.axial_counts == last.axial_counts);
    REQUIRE(report.transverse_counts == last.transverse_counts);
  }
  bench.sensor_dead = false;
  const protocol::InputReport healthy = bench.FrameUntilHealthy();
  CHECK(healthy.axial_counts == last.axial_counts + 1);
  CHECK(healthy.transverse_counts == last.transverse_counts + 2);
  CHECK(bench.Get<protocol::DiagnosticsReport>(protocol::kDiagnosticsReportId).sensor_faults > 0);
}

TEST_CASE("device time counts on over the wrap of the clock") {
  Bench bench;
  board().now_us = 0u - 300000u;
  bench.Start();
  std::uint32_t last = bench.Frame().device_time_us;
  for (int i = 0; i < 1000; ++i) {
    const std::uint32_t now = bench.Frame().device_time_us;
    REQUIRE(now - last >= 990);
    REQUIRE(now - last <= 1010);
    last = now;
  }
  CHECK(last < 1000000);
}

TEST_CASE("the identity report describes the device") {
  Bench bench;
  bench.Start();
  bench.FrameUntilHealthy();
  const auto identity = bench.Get<protocol::IdentityReport>(protocol::kIdentityReportId);
  CHECK(identity.protocol_version == protocol::kProtocolVersion);
  CHECK(identity.sensor_product_id == 0x42);
  CHECK(identity.cpu_mhz == 16);
  CHECK(std::string(identity.serial, 3) == "TQ-");
  CHECK((identity.self_test & 7) == 7);
  bench.sensor_dead = true;
  for (int i = 0; i < 10; ++i) bench.Frame();
  CHECK((bench.Get<protocol::IdentityReport>(protocol::kIdentityReportId).self_test & 4) == 0);
}

TEST_CASE("a configuration takes effect, is stored, and is refused when it makes no sense") {
  Bench bench;
  bench.Start();
  bench.FrameUntilHealthy();
  protocol::ConfigurationReport configuration = ConfigurationOf(800, 100);
  board().analog = {600, 700, 225};  // moved from the start: its rest is 512
  CHECK(bench.Set(configuration));
  for (int i = 0; i < 50; ++i) bench.Frame();
  const protocol::InputReport report = bench.Frame();
  CHECK(report.cpi == 800);
  CHECK(report.joystick_x == 512);
  CHECK(report.joystick_y == 700);
  CHECK(bench.Get<protocol::DiagnosticsReport>(protocol::kDiagnosticsReportId).settings_writes ==
        1);
  Settings stored;
  stored.Load();
  CHECK(stored.cpi() == 800);

  configuration.protocol_version = 99;
  CHECK_FALSE(bench.Set(configuration));
  configuration.protocol_version = protocol::kProtocolVersion;
  configuration.cpi = 850;
  CHECK_FALSE(bench.Set(configuration));
  CHECK(bench.Get<protocol::ConfigurationReport>(protocol::kConfigurationReportId).cpi == 800);
}

TEST_CASE("commands need their key; zero forgets the counts") {
  Bench bench;
  bench.Start();
  bench.FrameUntilHealthy();
  for (int i = 0; i < 20; ++i) bench.Frame();
  protocol::CommandReport command = CommandOf(protocol::kCommandZero);
  command.key = 1;
  CHECK_FALSE(bench.Set(command));
  CHECK(bench.Frame().axial_counts > 1);
  CHECK(bench.Set(CommandOf(protocol::kCommandZero)));
  CHECK(bench.Frame().axial_counts == 1);
  command = CommandOf(static_cast<protocol::Command>(200));
  CHECK_FALSE(bench.Set(command));
}

TEST_CASE("a restart leaves the host time to see its request acknowledged") {
  for (const auto& [command, what] : {std::pair{protocol::kCommandReset, "restart"},
                                      std::pair{protocol::kCommandEnterBootloader, "bootloader"}}) {
    Bench bench;
    bench.Start();
    bench.Frame();
    REQUIRE(bench.Set(CommandOf(command)));
    for (int i = 0; i < 8; ++i) bench.Frame();
    const auto on = [&bench] {
      for (int i = 0; i < 8; ++i) bench.Frame();
    };
    CHECK_THROWS_WITH(on(), what);
  }
}

TEST_CASE("a restart waits until the settings are stored, on a suspended bus too") {
  for (const bool suspended : {false, true}) {
    CAPTURE(suspended);
    Bench bench;
    bench.Start();
    bench.FrameUntilHealthy();
    for (const int cpi : {1600, 800}) {  // the second arrives during the first write
      REQUIRE(bench.Set(ConfigurationOf(cpi)));
      board().eeprom_busy_polls = 30;
      bench.Frame();
    }
    REQUIRE(bench.Set(CommandOf(protocol::kCommandReset)));
    board().bus_suspended = suspended;
    const auto on = [&] {
      for (int i = 0; i < 1000; ++i) {
        board().now_us += 1000;
        bench.firmware.Step();
      }
    };
    CHECK_THROWS_WITH(on(), "restart");
    Settings stored;
    stored.Load();
    CHECK(stored.cpi() == 800);
  }
}

TEST_CASE("on a suspended bus the sensor is sent to sleep, and started when the bus wakes") {
  Bench bench;
  bench.Start();
  bench.FrameUntilHealthy();
  board().bus_suspended = true;
  board().spi_log.clear();
  for (int i = 0; i < 10; ++i) bench.firmware.Step();
  REQUIRE(board().spi_log.size() == 2);  // one register is written, and no access follows
  CHECK(board().spi_log[0].sent == (0x3b | 0x80));
  CHECK(board().spi_log[1].sent == 0xb6);
  CHECK(board().watchdog_kicks > 10);
  board().bus_suspended = false;
  CHECK((bench.Frame().flags & protocol::kFlagSensorFault) != 0);
  bench.FrameUntilHealthy();
  CHECK(bench.Get<protocol::DiagnosticsReport>(protocol::kDiagnosticsReportId).sensor_faults == 0);
}

TEST_CASE("a sensor that was never started is not sent to sleep twice") {
  Bench bench;
  bench.Start();
  for (int round = 0; round < 3; ++round) {
    board().bus_suspended = true;
    board().now_us += 100000;  // longer than its power-up time
    for (int i = 0; i < 3; ++i) bench.firmware.Step();
    board().bus_suspended = false;
    bench.firmware.Step();
  }
  CHECK(board().spi_log.size() == 2);
}

TEST_CASE("a button wakes the host when pressed, not when held, and only with its leave") {
  Bench bench;
  bench.Start();
  bench.FrameUntilHealthy();
  board().buttons = protocol::kButtonClutch;
  for (int i = 0; i < 20; ++i) bench.Frame();
  board().bus_suspended = true;
  const auto doze = [&bench] {
    for (int i = 0; i < 10; ++i) bench.firmware.Step();
    return board().host_wakes;
  };
  CHECK(doze() == 0);
  board().buttons |= protocol::kButtonXray;
  CHECK(doze() == 0);  // the host did not allow it
  board().bus_suspended = false;
  board().setups.push_back({0x00, 3, 1, 0, 0, 0, 0, 0});
  bench.firmware.Step();
  board().bus_suspended = true;
  CHECK(doze() == 0);
  board().buttons = 0;
  CHECK(doze() == 0);
  board().buttons = protocol::kButtonContrast;
  CHECK(doze() == 1);
}

TEST_CASE("reports that cannot be read or written are refused") {
  Bench bench;
  bench.Start();
  std::uint8_t bytes[ReportHandler::kCapacity] = {};
  CHECK(bench.firmware.GetFeatureReport(protocol::kCommandReportId, bytes) == 0);
  CHECK(bench.firmware.GetFeatureReport(0, bytes) == 0);
  bytes[0] = protocol::kIdentityReportId;
  CHECK_FALSE(bench.firmware.SetFeatureReport(bytes, 32));
  bytes[0] = protocol::kConfigurationReportId;
  CHECK_FALSE(bench.firmware.SetFeatureReport(bytes, 15));
}

TEST_CASE("endpoint 0 is served early in a frame, and left alone late in it") {
  Bench bench;
  bench.Start();
  bench.Frame();
  const std::uint32_t start_us = board().now_us;
  board().frame_start_us = start_us;
  bench.firmware.Step();
  board().control_holds = 0;
  board().now_us = start_us + 700;
  board().setups.push_back({0x80, 8, 0, 0, 0, 0, 1, 0});
  bench.firmware.Step();
  CHECK(board().control_holds == 1);
  CHECK(board().setups.size() == 1);
  board().now_us = start_us + 1000;
  board().frame_start_us = start_us + 1000;
  bench.firmware.Step();
  CHECK(board().setups.empty());
  // A bus without frames: the firmware must not wait for one.
  board().now_us = start_us + 5000;
  board().setups.push_back({0x80, 8, 0, 0, 0, 0, 1, 0});
  bench.firmware.Step();
  CHECK(board().setups.empty());
}

TEST_CASE("a host that never stops asking does not keep the sensor from its upkeep") {
  Bench bench;
  bench.Start();
  for (int i = 0; i < 3000; ++i) {
    board().setups.push_back({0xa1, 1, 2, 3, 0, 0, 64, 0});
    if (!(bench.Frame().flags & protocol::kFlagSensorFault)) break;
  }
  CHECK_FALSE(bench.Frame().flags & protocol::kFlagSensorFault);
}

TEST_CASE("the end switch is in the reports, and zeroing the counts moves its mark") {
  Bench bench;
  bench.Start();
  bench.FrameUntilHealthy();
  for (int i = 0; i < 50; ++i) bench.Frame();
  board().buttons = board::kReferenceSwitch;
  const std::int32_t touched = bench.Frame().axial_counts;
  protocol::InputReport report{};
  for (int i = 0; i < 20; ++i) report = bench.Frame();
  CHECK((report.flags & protocol::kFlagReference) != 0);
  CHECK((report.flags & protocol::kFlagAtReference) != 0);
  CHECK(report.reference_counts == touched);
  CHECK(report.buttons == 0);
  REQUIRE(bench.Set(CommandOf(protocol::kCommandZero)));
  report = bench.Frame();
  CHECK(report.axial_counts == 1);
  CHECK(report.reference_counts == touched - (touched + 20));
  board().buttons = 0;
  for (int i = 0; i < 20; ++i) report = bench.Frame();
  CHECK_FALSE(report.flags & protocol::kFlagAtReference);
  CHECK((report.flags & protocol::kFlagReference) != 0);
}

TEST_CASE("diagnostics report where the stick rests") {
  Bench bench;
  board().analog = {538, 497, 225};
  bench.Start();
  protocol::InputReport report{};
  for (int i = 0; i < 150; ++i) report = bench.Frame();
  const auto diagnostics = bench.Get<protocol::DiagnosticsReport>(protocol::kDiagnosticsReportId);
  CHECK(diagnostics.joystick_rest_x == 538);
  CHECK(diagnostics.joystick_rest_y == 497);
  CHECK(report.joystick_x == 512);
  CHECK(report.joystick_y == 512);
}

}  // namespace
}  // namespace torquer::firmware
