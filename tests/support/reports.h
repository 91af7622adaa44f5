// Input reports for tests.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>

#include "protocol/hid_reports.h"

namespace torquer::test {

/// A report of a device at rest, all well: 1200 cpi, joystick centered.
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

/// The next millisecond of the same device.
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

}  // namespace torquer::test
