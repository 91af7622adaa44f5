// Test fixture: the daemon on unmodified libusb, with scripted devices in a mocked kernel.
#pragma once

#include <catch2/catch.hpp>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "protocol/hid_reports.h"
#include "protocol/usb_ids.h"
#include "tests/support/daemon_process.h"
#include "tests/support/reports.h"
#include "tests/support/usb_testbed.h"

namespace torquer::test {

constexpr double kMmPerCount = 25.4 / 1200;
constexpr int kAddress = 5;

/// Bytes of a report as on the wire.
template <class Report>
std::vector<std::uint8_t> Bytes(const Report& report) {
  std::vector<std::uint8_t> bytes(sizeof report);
  std::memcpy(bytes.data(), &report, sizeof report);
  return bytes;
}

/// Script of a healthy bench device.
inline UsbDeviceScript Bench(const std::string& serial = "BENCH-7") {
  protocol::IdentityReport identity{};
  identity.report_id = protocol::kIdentityReportId;
  identity.protocol_version = protocol::kProtocolVersion;
  serial.copy(identity.serial, sizeof identity.serial);
  const protocol::ConfigurationReport configuration = ConfigurationOf(1200);

  UsbDeviceScript script;
  script.vendor_id = protocol::kUsbVendorId;
  script.product_id = protocol::kUsbProductId;
  script.manufacturer = protocol::kUsbManufacturer;
  script.product = protocol::kUsbProduct;
  script.serial = serial;
  script.control = [=](const ControlRequest& request) -> ControlAnswer {
    // GET_REPORT of a feature report, addressed to the interface.
    if (request.type == 0xa1 && request.request == 1) {
      if (request.value == 0x0302) return {ControlAnswer::Kind::kData, Bytes(identity)};
      if (request.value == 0x0303) return {ControlAnswer::Kind::kData, Bytes(configuration)};
    }
    return {ControlAnswer::Kind::kStall};
  };
  return script;
}

inline InputStep Sends(const protocol::InputReport& report) {
  return {InputStep::Kind::kData, Bytes(report)};
}

/// Scripted devices on a mocked bus, and a daemon that reads them.
struct UsbChain {
  std::unique_ptr<ChildProcess> Start(const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{kDaemonProgram, "--source", "usb", "--uncalibrated"};
    words.insert(words.end(), more.begin(), more.end());
    return std::make_unique<ChildProcess>(words);
  }
  /// Plugs in a device and starts a daemon, which reads it.
  std::unique_ptr<ChildProcess> Read(const UsbDeviceScript& script = Bench()) {
    testbed.Plug(kAddress, script);
    auto daemon = Start();
    REQUIRE(daemon->WaitForError("reading device " + script.serial));
    return daemon;
  }
  /// Sends reports that advance by `counts` each; returns the last resulting command.
  torquer_lcm::instrument_command_t Push(int address, int reports, int counts) {
    listener.Forget();
    for (int i = 0; i < reports; ++i) {
      report = Next(report);
      report.axial_counts += counts;
      testbed.Input(address, Sends(report));
    }
    REQUIRE(listener.UntilCommands(static_cast<std::size_t>(reports)));
    return listener.commands.back();
  }

  Listener listener{/*with_devices=*/true};
  UsbTestbed testbed;
  protocol::InputReport report = StillReport();
};

}  // namespace torquer::test
