// Feature reports of one bench device, through any source.
#pragma once

#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

namespace torquer::device {

/// Thrown if the device has refused a report by a STALL.
class ReportRefused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Both functions throw ReportRefused. After an unplug they throw an exception of the
/// implementation. A request may take a second.
class FeatureReports {
 public:
  FeatureReports() = default;
  FeatureReports(const FeatureReports&) = delete;
  FeatureReports& operator=(const FeatureReports&) = delete;
  virtual ~FeatureReports() = default;

  /// `size` bytes or fewer, report id first.
  virtual std::vector<std::uint8_t> Get(std::uint8_t report_id, std::size_t size) = 0;
  virtual void Set(std::span<const std::uint8_t> report) = 0;
};

}  // namespace torquer::device
