// HID reports for tests: from a device at rest, and from a correct host.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>

#include "protocol/hid_reports.h"

namespace torquer::test {

/// Report of a healthy device at rest: 1200 cpi, joystick centered.
inline protocol::InputReport StillReport(std::uint16_t sequence = 0) {
  protocol::InputReport report{};
  report.report_id = protocol::kInputReportId;
  report.protocol_version = protocol::kProtocolVersion;
  report.boot_id = 7;
  report.sequence = sequence;
  report.device_time_us = 1000u * sequence;
  report.joystick_x = 512;
  report.joystick_y = 512;
  report.surface_quality = 60;
  report.shutter = 100;
  report.cpi = 1200;
  return report;
}

/// Next report of the same device, one millisecond later.
inline protocol::InputReport Next(protocol::InputReport report) {
  ++report.sequence;
  report.device_time_us += 1000;
  return report;
}

inline std::array<std::uint8_t, sizeof(protocol::InputReport)> BytesOf(
    const protocol::InputReport& report) {
  std::array<std::uint8_t, sizeof report> bytes;
  std::memcpy(bytes.data(), &report, sizeof report);
  return bytes;
}

/// Settings that a device accepts if `cpi` is a resolution of its sensor. `deadzone` is in counts
/// of the joystick's converter.
inline protocol::ConfigurationReport ConfigurationOf(int cpi, int deadzone = 0) {
  protocol::ConfigurationReport configuration{};
  configuration.report_id = protocol::kConfigurationReportId;
  configuration.protocol_version = protocol::kProtocolVersion;
  configuration.cpi = static_cast<std::uint16_t>(cpi);
  configuration.joystick_deadzone = static_cast<std::uint16_t>(deadzone);
  return configuration;
}

/// `command` with the key that a device requires.
inline protocol::CommandReport CommandOf(protocol::Command command) {
  return {protocol::kCommandReportId, command, protocol::kCommandKey, {}};
}

}  // namespace torquer::test
