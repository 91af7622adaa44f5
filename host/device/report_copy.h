// Feature report as its struct.
#pragma once

#include <cstring>
#include <string>

#include "host/device/feature_reports.h"
#include "host/support/error.h"
#include "protocol/hid_reports.h"

namespace torquer::device {

/// Throws UserError if the device's report has another length or version than `Report`.
template <typename Report>
Report GetReport(FeatureReports& reports, std::uint8_t id) {
  const std::vector<std::uint8_t> bytes = reports.Get(id, sizeof(Report));
  Report report;
  if (bytes.size() != sizeof(report) || bytes[0] != id) {
    throw UserError("the device's report " + std::to_string(id) + " has " +
                    std::to_string(bytes.size()) + " bytes where it should have " +
                    std::to_string(sizeof(report)) + "; run torquer-flash to renew its firmware");
  }
  std::memcpy(&report, bytes.data(), sizeof(report));
  if (report.protocol_version != protocol::kProtocolVersion) {
    throw UserError("the device speaks version " + std::to_string(report.protocol_version) +
                    " of the protocol, this program version " +
                    std::to_string(protocol::kProtocolVersion) + "; run torquer-flash");
  }
  return report;
}

}  // namespace torquer::device
