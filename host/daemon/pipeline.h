// Pipeline from the bytes of a report to a command: bytes -> sample -> time of sampling -> hand
// state. No I/O, no clock: the same reports and arrival times give the same outputs, bit for bit.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "host/daemon/hand_tracker.h"
#include "host/device/clock_map.h"
#include "host/device/report_decoder.h"

namespace torquer::daemon {

/// Result of one report.
struct PipelineOutput {
  device::Sample sample;
  std::int64_t origin_us = 0;  ///< host time of sampling
  HandState hand;
};

class Pipeline {
 public:
  explicit Pipeline(HandTracker tracker) : tracker_(std::move(tracker)) {}

  /// A device was connected; its numbers may begin at any value.
  void OnConnected() { decoder_.OnConnected(); }

  /// Processes one report. nullopt without new data; decoder().counters() shows the reason.
  std::optional<PipelineOutput> OnReport(std::span<const std::uint8_t> report,
                                         std::int64_t receive_us) {
    const std::optional<device::Sample> sample = decoder_.Decode(report, receive_us);
    if (!sample) return std::nullopt;
    if (sample->epoch_start != device::EpochStart::kNone) clock_map_.Reset();
    const std::int64_t origin_us = clock_map_.Map(sample->device_time_us, receive_us);
    return PipelineOutput{*sample, origin_us, tracker_.Step(*sample)};
  }

  HandState Hold() const { return tracker_.Hold(); }
  void Home() { tracker_.Home(); }
  void ForgetMark() { tracker_.ForgetMark(); }

  const device::ReportDecoder& decoder() const { return decoder_; }
  const device::ClockMap& clock_map() const { return clock_map_; }
  const HandTracker& tracker() const { return tracker_; }

 private:
  device::ReportDecoder decoder_;
  device::ClockMap clock_map_;
  HandTracker tracker_;
};

}  // namespace torquer::daemon
