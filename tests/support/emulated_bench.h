// Emulated device and its host for tests, with the data that the host received.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <string>
#include <vector>

#include "host/emulator/bench_device.h"
#include "host/emulator/usb_host.h"
#include "protocol/hid_reports.h"
#include "tests/support/paths.h"
#include "tests/support/reports.h"

namespace torquer::emulator {

inline FirmwareImage Image16() {
  return FirmwareImage(torquer::test::FirmwarePath("torquer-firmware.elf"));
}
inline FirmwareImage Image8() {
  return FirmwareImage(torquer::test::FirmwarePath("torquer-firmware-8mhz.elf"));
}

/// Crystal of 16 MHz, CPU at 8 MHz.
inline FirmwareImage Image16To8() {
  return FirmwareImage(torquer::test::FirmwarePath("torquer-firmware-16to8mhz.elf"));
}

/// Stand-in for the sensor vendor's firmware image, number 5.
inline std::vector<std::uint8_t> TestSrom() {
  std::vector<std::uint8_t> image(protocol::kSromBytes);
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = static_cast<std::uint8_t>(i * i / 7);
  image[0] = 0x01;
  image[1] = 0x05;
  return image;
}

struct Bench {
  explicit Bench(const BenchOptions& options = {}, const FirmwareImage& image = Image16())
      : device(image, options), host(device) {
    host.wants_input = [this] { return polling; };
    host.on_input = [this](const std::vector<std::uint8_t>& packet) {
      REQUIRE(packet.size() == sizeof(protocol::InputReport));
      protocol::InputReport report;
      std::memcpy(&report, packet.data(), sizeof(report));
      if (reports != 0 && report.sequence != static_cast<std::uint16_t>(last.sequence + 1)) ++gaps;
      last = report;
      ++reports;
    };
  }

  void Run(double seconds) {
    const double end_us = device.now_us() + seconds * 1e6;
    while (device.now_us() < end_us - 1) host.RunFrame();
  }
  /// Runs until the device is enumerated (again) and its sensor answers.
  void Start() {
    reports = 0;
    for (int i = 0; i < 3000 && (reports == 0 || (last.flags & protocol::kFlagSensorFault)); ++i) {
      host.RunFrame();
      if (!host.ready()) reports = 0;
    }
    REQUIRE(reports > 0);
    REQUIRE_FALSE(last.flags & protocol::kFlagSensorFault);
    reports = gaps = 0;
  }
  template <typename Report>
  Report Get(std::uint8_t id) {
    const ControlResult result = host.GetFeature(id);
    REQUIRE(result.status == TransferStatus::kDone);
    REQUIRE(result.data.size() == sizeof(Report));
    Report report;
    std::memcpy(&report, result.data.data(), sizeof(report));
    return report;
  }
  template <typename Report>
  TransferStatus Set(const Report& report) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(&report);
    return host.SetFeature(std::vector<std::uint8_t>(bytes, bytes + sizeof(report))).status;
  }
  TransferStatus Configure(int cpi, int deadzone) {
    return Set(test::ConfigurationOf(cpi, deadzone));
  }
  TransferStatus Command(protocol::Command command) { return Set(test::CommandOf(command)); }
  void LoadSrom(const std::vector<std::uint8_t>& image) {
    std::vector<std::uint8_t> report(1 + image.size(), protocol::kSromReportId);
    std::copy(image.begin(), image.end(), report.begin() + 1);
    REQUIRE(host.SetFeature(report).status == TransferStatus::kDone);
  }
  protocol::DiagnosticsReport Diagnostics() {
    return Get<protocol::DiagnosticsReport>(protocol::kDiagnosticsReportId);
  }
  /// Checks that no rule of the hardware was violated.
  void CheckRules() {
    for (const std::string& violation : device.Violations()) FAIL_CHECK(violation);
  }

  BenchDevice device;
  UsbHost host;
  bool polling = true;
  protocol::InputReport last{};
  int reports = 0;
  int gaps = 0;
};

}  // namespace torquer::emulator
