// The firmware on another board: a USB stack that exchanges whole reports, and a sensor that is not
// a PMW3360. These parts do not use packets of endpoint 0, nor the SPI.
#include <catch2/catch.hpp>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <functional>
#include <vector>

#include "firmware/src/bench_firmware.h"
#include "protocol/firmware_image.h"
#include "tests/firmware/fake_board.h"
#include "tests/support/reports.h"

namespace torquer::firmware {
namespace {

/// Stack of another controller: requests of the host wait as functions until Poll().
class ReportStack final : public UsbStack {
 public:
  ReportStack(ReportHandler& reports, LongReportHandler& long_reports)
      : reports_(reports), long_reports_(long_reports) {}

  bool Poll() override {
    held = false;
    if (requests.empty()) return false;
    const std::function<void()> request = requests.front();
    requests.pop_front();
    request();
    return true;
  }
  bool RequestPending() const override { return !requests.empty(); }
  void Hold() override { held = true; }
  bool configured() const override { return is_configured; }
  bool may_wake_host() const override { return may_wake; }
  void SendInput(const protocol::InputReport& report) override { sent.push_back(report); }
  uint16_t frames_missed() const override { return 3; }

  ReportHandler& reports() { return reports_; }
  LongReportHandler& long_reports() { return long_reports_; }

  std::deque<std::function<void()>> requests;
  std::vector<protocol::InputReport> sent;
  bool is_configured = true, may_wake = false, held = false;

 private:
  ReportHandler& reports_;
  LongReportHandler& long_reports_;
};

/// Sensor with another id; each reading is the next of `motion`.
class OtherSensor final : public MotionSensor {
 public:
  void Start(uint16_t cpi) override { cpi_ = cpi; }
  void BeginRead() override {}
  MotionSample Read() override {
    MotionSample sample;
    sample.delta_x = x;
    sample.delta_y = y;
    sample.fault = asleep;
    if (asleep) sample.delta_x = sample.delta_y = 0;
    return sample;
  }
  void Maintain() override { ++maintained; }
  void Sleep() override { asleep = true; }
  void Wake() override { asleep = false; }
  void SetCpi(uint16_t cpi) override { cpi_ = cpi; }
  uint16_t cpi() const override { return cpi_; }
  uint8_t product_id() const override { return 0x51; }
  uint8_t revision() const override { return 9; }
  uint16_t restarts() const override { return 4; }
  bool running() const override { return !asleep; }
  uint16_t self_resets() const override { return 2; }
  protocol::SensorFaultCause fault_cause() const override { return protocol::kSensorFrozen; }
  uint8_t observation() const override { return 0; }
  uint8_t srom_id() const override { return 0; }
  bool srom_lost() const override { return false; }

  int16_t x = -2, y = 1;  // counts of a reading
  int maintained = 0;
  bool asleep = false;

 private:
  uint16_t cpi_ = 0;
};

/// A sensor without picture and image.
class NoSensorReports final : public SensorReports {
 public:
  bool BeginWrite(uint8_t, uint16_t) override { return false; }
  bool HasRoom() const override { return false; }
  void Put(uint8_t) override {}
  Progress EndWrite() override { return Progress::kRefused; }
  bool BeginRead(uint8_t) override { return false; }
  Progress Read(const uint8_t**, uint16_t*) override { return Progress::kRefused; }
  void Abandon() override {}
  void Note(const MotionSample&) override {}
  bool Run() override { return false; }
  uint8_t capabilities() const override { return 0; }
};

struct OtherBoard {
  explicit OtherBoard(MotionSensor* second = nullptr)
      : firmware(sensor, sensor_reports, usb, second) {
    NewBoard();
    firmware.Start();
  }
  void Frame() {
    const std::uint32_t start_us = board().now_us;
    board().frame_start_us = start_us;
    firmware.Step();
    board().now_us = start_us + 1000;
  }
  template <typename Report>
  Report Get(std::uint8_t id) {
    Report report{};
    usb.requests.push_back([&] {
      std::uint8_t bytes[ReportHandler::kCapacity];
      REQUIRE(usb.reports().GetFeatureReport(id, bytes) == sizeof(report));
      std::memcpy(&report, bytes, sizeof(report));
    });
    for (int i = 0; i < 10 && usb.RequestPending(); ++i) Frame();
    REQUIRE_FALSE(usb.RequestPending());
    return report;
  }
  template <typename Report>
  bool Set(const Report& report) {
    bool taken = false;
    usb.requests.push_back([&] {
      taken = usb.reports().SetFeatureReport(reinterpret_cast<const std::uint8_t*>(&report),
                                             sizeof(report));
    });
    for (int i = 0; i < 10 && usb.RequestPending(); ++i) Frame();
    return taken;
  }

  OtherSensor sensor;
  NoSensorReports sensor_reports;
  ReportStack usb{firmware, sensor_reports};
  BenchFirmware firmware;
};

TEST_CASE("on another board, each frame sends a report with the motion of another sensor") {
  OtherBoard other;
  for (int i = 0; i < 100; ++i) other.Frame();
  REQUIRE(other.usb.sent.size() == 100);
  for (std::size_t i = 1; i < other.usb.sent.size(); ++i) {
    const protocol::InputReport& before = other.usb.sent[i - 1];
    CHECK(other.usb.sent[i].sequence == before.sequence + 1);
    CHECK(other.usb.sent[i].axial_counts == before.axial_counts + 1);
    CHECK(other.usb.sent[i].transverse_counts == before.transverse_counts + 2);
  }
  CHECK(other.usb.sent.back().flags == 0);
  CHECK(other.sensor.maintained > 90);
  other.usb.is_configured = false;
  other.Frame();
  CHECK(other.usb.sent.size() == 100);
}

TEST_CASE("on another board, reports name the sensor and its capabilities") {
  OtherBoard other;
  const auto identity = other.Get<protocol::IdentityReport>(protocol::kIdentityReportId);
  CHECK(identity.sensor_product_id == 0x51);
  CHECK(identity.sensor_revision == 9);
  CHECK(identity.board == protocol::kBoardBenchAtmega32u4);
  CHECK(identity.capabilities == (protocol::kCapabilityClosedAtRest | protocol::kCapabilitySupply));
  CHECK(std::string(identity.serial, 3) == "TQ-");
  CHECK(std::string(other.usb.reports().serial()) == identity.serial);
  const auto diagnostics = other.Get<protocol::DiagnosticsReport>(protocol::kDiagnosticsReportId);
  CHECK(diagnostics.sensor_faults == 4);
  CHECK(diagnostics.sensor_resets == 2);
  CHECK(diagnostics.sensor_fault_cause == protocol::kSensorFrozen);
  CHECK(diagnostics.frames_missed == 3);
  CHECK(other.Set(test::ConfigurationOf(3200, 30)));
  for (int i = 0; i < 100; ++i) other.Frame();
  CHECK(other.sensor.cpi() == 3200);
  CHECK_FALSE(other.usb.long_reports().BeginRead(protocol::kPictureReportId));
  CHECK_FALSE(
      other.usb.long_reports().BeginWrite(protocol::kSromReportId, sizeof(protocol::SromReport)));
}

TEST_CASE("two sensors take turns, each with its reports, counts and upkeep") {
  OtherSensor second;
  second.x = -20, second.y = 10;
  OtherBoard other(&second);
  for (int i = 0; i < 100; ++i) other.Frame();
  REQUIRE(other.usb.sent.size() == 100);
  for (std::size_t i = 0; i < 100; ++i) {
    const protocol::InputReport& report = other.usb.sent[i];
    CHECK(report.report_id ==
          (i % 2 == 0 ? protocol::kInputReportId : protocol::kSecondInputReportId));
    CHECK(report.sequence == i / 2 + 1);
    CHECK(report.axial_counts == static_cast<int>((i / 2 + 1) * (i % 2 == 0 ? 1 : 10)));
    CHECK(report.boot_id == other.usb.sent[0].boot_id);
  }
  CHECK(std::abs(other.sensor.maintained - second.maintained) <= 2);
  std::uint8_t report[ReportHandler::kCapacity];
  CHECK(other.firmware.GetInputReport(protocol::kSecondInputReportId, report) == 32);
  CHECK(std::memcmp(report, &other.usb.sent[99], 32) == 0);

  const auto identity = other.Get<protocol::IdentityReport>(protocol::kIdentityReportId);
  CHECK((identity.capabilities & protocol::kCapabilitySecondSensor) != 0);
  CHECK(identity.second_product_id == 0x51);
  CHECK(identity.second_revision == 9);
  CHECK((identity.self_test & 12) == 12);
  const auto diagnostics = other.Get<protocol::DiagnosticsReport>(protocol::kDiagnosticsReportId);
  CHECK(diagnostics.second_faults == 4);
  CHECK(diagnostics.second_resets == 2);
  CHECK(diagnostics.second_fault_cause == protocol::kSensorFrozen);
  CHECK(other.Set(test::ConfigurationOf(3200, 30)));
  for (int i = 0; i < 100; ++i) other.Frame();
  CHECK(second.cpi() == 3200);
  CHECK(other.Set(test::CommandOf(protocol::kCommandZero)));
  other.Frame();
  other.Frame();
  CHECK(other.usb.sent.back().axial_counts < 100);

  board().bus_suspended = true;
  for (int i = 0; i < 5; ++i) other.firmware.Step();
  CHECK(second.asleep);
  board().bus_suspended = false;
  other.firmware.Step();
  CHECK_FALSE(second.asleep);
}

TEST_CASE("a board with one sensor sends and answers nothing of a second") {
  OtherBoard other;
  for (int i = 0; i < 20; ++i) other.Frame();
  for (const protocol::InputReport& report : other.usb.sent) {
    CHECK(report.report_id == protocol::kInputReportId);
  }
  std::uint8_t report[ReportHandler::kCapacity];
  CHECK(other.firmware.GetInputReport(protocol::kSecondInputReportId, report) == 0);
  const auto identity = other.Get<protocol::IdentityReport>(protocol::kIdentityReportId);
  CHECK((identity.capabilities & protocol::kCapabilitySecondSensor) == 0);
  CHECK(identity.second_product_id == 0);
}

TEST_CASE("on another board, no packet and no byte of the SPI is used, and suspend works") {
  OtherBoard other;
  for (int i = 0; i < 10; ++i) other.Frame();
  other.usb.may_wake = true;
  board().bus_suspended = true;
  for (int i = 0; i < 5; ++i) other.firmware.Step();
  CHECK(other.sensor.asleep);
  board().buttons = protocol::kButtonClutch;
  for (int i = 0; i < 5; ++i) other.firmware.Step();
  CHECK(board().host_wakes == 1);
  board().bus_suspended = false;
  other.firmware.Step();
  CHECK_FALSE(other.sensor.asleep);
  CHECK(board().spi_log.empty());
  CHECK(board().inputs.empty());
  CHECK(board().control_sent.empty());
  CHECK(board().control_holds == 0);
}

TEST_CASE("on another board, requests late in a frame are held for the next one") {
  OtherBoard other;
  other.Frame();
  board().frame_start_us = board().now_us;
  other.firmware.Step();
  board().now_us += 700;
  bool served = false;
  other.usb.requests.emplace_back([&served] { served = true; });
  other.firmware.Step();
  CHECK_FALSE(served);
  CHECK(other.usb.held);
  other.Frame();
  CHECK(served);
}

}  // namespace
}  // namespace torquer::firmware
