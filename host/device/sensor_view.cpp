#include "host/device/sensor_view.h"

#include <cstring>
#include <utility>

#include "protocol/hid_reports.h"

namespace torquer::device {

SensorView::SensorView(std::shared_ptr<ReportSource> box, int sensor)
    : box_(std::move(box)), sensor_(sensor) {}

SensorView::SensorView(SensorView* first) : box_(first->box_), sensor_(2), first_(first) {
  first->second_ = this;
}

void SensorView::Wait(int timeout_ms, const Sink& sink) {
  if (first_ != nullptr) {
    while (!kept_.empty()) {
      Kept kept = std::move(kept_.front());
      kept_.pop_front();
      kept.event.report = kept.report;
      Pass(kept.event, sink);
    }
    return;
  }
  box_->Wait(timeout_ms, [&](const SourceEvent& event) {
    Pass(event, sink);
    if (second_ != nullptr) {
      second_->kept_.push_back({event, {event.report.begin(), event.report.end()}});
    }
  });
}

// Reports of the second sensor are passed on with the id of the first, which decoders expect.
void SensorView::Pass(const SourceEvent& event, const Sink& sink) const {
  const bool of_second = !event.report.empty() && event.report[0] == protocol::kSecondInputReportId;
  if (event.kind != SourceEvent::Kind::kReport || (sensor_ == 1 && !of_second)) {
    sink(event);
    return;
  }
  if (sensor_ == 1 || !of_second) return;
  std::vector<std::uint8_t> report(event.report.begin(), event.report.end());
  report[0] = protocol::kInputReportId;
  SourceEvent own = event;
  own.report = report;
  sink(own);
}

void SensorView::SetFeature(std::span<const std::uint8_t> report) {
  protocol::ConfigurationReport asked{};
  if (sensor_ == 2 && report.size() == sizeof asked &&
      report[0] == protocol::kConfigurationReportId) {
    std::memcpy(&asked, report.data(), sizeof asked);
    const std::vector<std::uint8_t> now = GetFeature(protocol::kConfigurationReportId);
    protocol::ConfigurationReport found{};
    if (now.size() == sizeof found) std::memcpy(&found, now.data(), sizeof found);
    if (asked.cpi != found.cpi) {
      throw FeatureError("the resolution is that of the first sensor");
    }
  }
  box_->SetFeature(report);
}

}  // namespace torquer::device
