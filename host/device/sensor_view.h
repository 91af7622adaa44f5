// View of a box: the reports of one of its sensors. A box with two sensors sends the reports of
// both; each sensor has its report id.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "host/device/report_source.h"

namespace torquer::device {

class SensorView final : public ReportSource {
 public:
  /// Sensor 1 or 2 of `box`. The reports of the other one are dropped.
  SensorView(std::shared_ptr<ReportSource> box, int sensor);
  /// Second sensor of the box that `first` reads. Its events come from first.Wait(); its own Wait()
  /// does not read. `first` is not null and must outlive it.
  explicit SensorView(SensorView* first);

  void Wait(int timeout_ms, const Sink& sink) override;
  void LetGo(const std::string& reason) override { box_->LetGo(reason); }
  void Interrupt() override { box_->Interrupt(); }
  std::vector<std::uint8_t> GetFeature(std::uint8_t report_id) override {
    return box_->GetFeature(report_id);
  }
  /// The resolution is that of both sensors, and the first one's: another view does not change it.
  void SetFeature(std::span<const std::uint8_t> report) override;
  std::string place() const override { return box_->place(); }
  int sensor() const override { return sensor_; }

 private:
  struct Kept {
    SourceEvent event;
    std::vector<std::uint8_t> report;
  };

  void Pass(const SourceEvent& event, const Sink& sink) const;

  std::shared_ptr<ReportSource> box_;
  const int sensor_;
  SensorView* first_ = nullptr;   // view that reads for this one
  SensorView* second_ = nullptr;  // view for which this one reads
  std::deque<Kept> kept_;         // events for Wait(), of a view that does not read
};

}  // namespace torquer::device
