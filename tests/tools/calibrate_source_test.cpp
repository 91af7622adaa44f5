// Readings in a calibration, made from a device's reports by a scripted source.
#include "host/tools/calibrate_source.h"

#include <catch2/catch.hpp>
#include <cstring>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "host/support/error.h"
#include "protocol/hid_reports.h"
#include "tests/support/reports.h"

namespace {

using Catch::Contains;
using torquer::calibration::Key;
using torquer::calibration::Reading;
using torquer::calibration::Step;
using torquer::device::ReportSource;
using torquer::device::SourceEvent;
using torquer::protocol::InputReport;
using torquer::test::Next;
using torquer::test::StillReport;
using torquer::tools::DeviceReadings;

// Report source whose every Wait() runs the next of `waits`.
class ToldSource : public ReportSource {
 public:
  void Wait(int /*timeout_ms*/, const Sink& sink) override {
    if (next_ < waits.size()) waits[next_++](sink);
  }
  void LetGo(const std::string& /*reason*/) override {}
  void Interrupt() override {}
  std::vector<std::uint8_t> GetFeature(std::uint8_t /*report_id*/) override {
    torquer::protocol::IdentityReport identity{};
    identity.report_id = torquer::protocol::kIdentityReportId;
    identity.protocol_version = torquer::protocol::kProtocolVersion;
    serial.copy(identity.serial, sizeof identity.serial);
    std::vector<std::uint8_t> bytes(sizeof identity);
    std::memcpy(bytes.data(), &identity, sizeof identity);
    return bytes;
  }
  void SetFeature(std::span<const std::uint8_t> /*report*/) override {}
  std::string place() const override { return "a test"; }

  static void Connect(const Sink& sink) {
    sink({.kind = SourceEvent::Kind::kConnected, .host_us = 0, .report = {}, .text = "a test"});
  }
  static void Send(const Sink& sink, const InputReport& report) {
    const auto bytes = torquer::test::BytesOf(report);
    sink({.kind = SourceEvent::Kind::kReport,
          .host_us = static_cast<std::int64_t>(report.device_time_us),
          .report = bytes,
          .text = {}});
  }

  std::string serial = "SAID-1";
  std::vector<std::function<void(const Sink&)>> waits;

 private:
  std::size_t next_ = 0;
};

class ReadingLog : public torquer::tools::ReadingSink {
 public:
  void Take(const Reading& reading) override { readings.push_back(reading); }
  void Press(Key /*key*/) override {}
  void Quit() override {}
  void Inform(const std::string& text) override { said += text + "\n"; }
  Step step() const override { return Step::kRest; }

  std::vector<Reading> readings;
  std::string said;
};

struct Bench {
  Bench() : source(new ToldSource), readings(std::unique_ptr<ReportSource>(source), false, true) {
    source->waits.emplace_back([this](const ReportSource::Sink& sink) {
      ToldSource::Connect(sink);
      for (int i = 0; i < 3; ++i) Send(sink);
    });
  }
  void Send(const ReportSource::Sink& sink) {
    ToldSource::Send(sink, report);
    report = Next(report);
  }
  // Sends one more report; returns the reading made from it.
  Reading After(const std::function<void(InputReport&)>& change) {
    change(report);
    source->waits.emplace_back([this](const ReportSource::Sink& sink) { Send(sink); });
    readings.Wait(0, log);
    REQUIRE_FALSE(log.readings.empty());
    return log.readings.back();
  }

  InputReport report = StillReport();
  ToldSource* source;  // owned by `readings`
  DeviceReadings readings;
  ReadingLog log;
};

}  // namespace

TEST_CASE("No reading is lost during a request for the device's identity") {
  Bench bench;
  const torquer::tools::DeviceFacts facts = bench.readings.Connect();
  CHECK(facts.serial == "SAID-1");
  CHECK(facts.cpi == 1200);
  bench.readings.Wait(0, bench.log);
  REQUIRE(bench.log.readings.size() == 3);
  CHECK(bench.log.readings[0].interrupted);
  CHECK(bench.log.readings[2].time_us == 2000);
  CHECK_FALSE(bench.log.readings[2].interrupted);
}

TEST_CASE("Flags, quality, buttons and restarts are reported with the reading") {
  Bench bench;
  bench.readings.Connect();
  const Reading still = bench.After([](InputReport&) {});
  CHECK_FALSE(still.lifted);
  CHECK_FALSE(still.faulty);
  CHECK_FALSE(still.interrupted);
  CHECK_FALSE(still.button);
  const auto flag = [](std::uint8_t bits) {
    return [bits](InputReport& report) { report.flags = bits; };
  };
  CHECK(bench.After(flag(torquer::protocol::kFlagLift)).lifted);
  CHECK(bench.After(flag(torquer::protocol::kFlagSensorFault)).faulty);
  bench.report.flags = 0;
  CHECK(bench.After([](InputReport& report) { report.surface_quality = 9; }).lifted);
  CHECK_FALSE(bench.After([](InputReport& report) { report.surface_quality = 10; }).lifted);
  CHECK(bench.After([](InputReport& report) { report.buttons = torquer::protocol::kButtonXray; })
            .button);
  CHECK(bench.After([](InputReport& report) { ++report.boot_id; }).interrupted);
}

TEST_CASE("A fault that would spoil a calibration ends the run with the reason") {
  Bench bench;
  bench.readings.Connect();
  SECTION("another resolution") {
    CHECK_THROWS_WITH(bench.After([](InputReport& report) { report.cpi = 800; }),
                      Contains("resolution changed from 1200 to 800 cpi"));
  }
  SECTION("another device") {
    bench.source->serial = "SAID-2";
    bench.source->waits.emplace_back(ToldSource::Connect);
    CHECK_THROWS_WITH(bench.readings.Wait(0, bench.log),
                      Contains("'SAID-1' was replaced by 'SAID-2'"));
  }
  SECTION("the same device, back again, does not") {
    bench.source->waits.emplace_back([](const ReportSource::Sink& sink) {
      sink({.kind = SourceEvent::Kind::kDisconnected,
            .host_us = 0,
            .report = {},
            .text = "it was unplugged"});
      ToldSource::Connect(sink);
    });
    bench.readings.Wait(0, bench.log);
    CHECK(bench.log.said == "it was unplugged; waiting for it\nthe device is connected again\n");
    CHECK(bench.After([](InputReport&) {}).interrupted);
  }
}
