// Reports of a board in firmware or bootloader, as structures.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "host/tools/flash_board.h"
#include "protocol/bootloader_reports.h"
#include "protocol/hid_reports.h"

namespace torquer::tools {

/// Bits of IdentityReport::self_test.
inline constexpr std::uint8_t kApplicationGood = 1 << 0, kSettingsGood = 1 << 1,
                              kSensorGood = 1 << 2, kSecondSensorGood = 1 << 3;
/// Interval between two looks at the boards.
inline constexpr int kLookMs = 50;

/// Throws ReportRefused or BoardLost.
template <typename Report>
Report Get(FeatureLink& link, std::uint8_t id) {
  const std::vector<std::uint8_t> bytes = link.Get(id, sizeof(Report));
  if (bytes.size() != sizeof(Report)) {
    throw ReportRefused(
        fmt::format("report {} has {} bytes instead of {}", id, bytes.size(), sizeof(Report)));
  }
  Report report;
  std::memcpy(&report, bytes.data(), sizeof(report));
  return report;
}

template <typename Report>
void Set(FeatureLink& link, const Report& report) {
  link.Set({reinterpret_cast<const std::uint8_t*>(&report), sizeof(report)});
}

/// Serial number of a board in the bootloader.
std::string SerialOf(const protocol::BootloaderStatusReport& status);
/// Place of a board, for messages.
std::string Where(const Board& board);

}  // namespace torquer::tools
