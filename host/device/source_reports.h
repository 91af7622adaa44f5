// Feature reports of the device that a source reads.
#pragma once

#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "host/device/feature_reports.h"
#include "host/device/report_source.h"

namespace torquer::device {

/// Also throws DeviceGone. A request that the device does not answer in time counts as refused.
class SourceReports final : public FeatureReports {
 public:
  explicit SourceReports(ReportSource& source) : source_(source) {}

  std::vector<std::uint8_t> Get(std::uint8_t report_id, std::size_t /*size*/) override {
    return Translate([&] { return source_.GetFeature(report_id); });
  }
  void Set(std::span<const std::uint8_t> report) override {
    Translate([&] { source_.SetFeature(report); });
  }

 private:
  template <typename Request>
  static std::invoke_result_t<Request> Translate(Request request) {
    try {
      return request();
    } catch (const DeviceGone&) {
      throw;
    } catch (const FeatureError& error) {
      throw ReportRefused(error.what());
    }
  }

  ReportSource& source_;
};

}  // namespace torquer::device
