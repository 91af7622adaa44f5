// The daemon's latency from the arrival of a report to its command, and its share of the processor.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace torquer::daemon {

class Statistics {
 public:
  Statistics();

  /// Adds the latency of one report: its command was on the bus `us` after it arrived.
  void AddLatency(std::int64_t us);

  std::int64_t count() const { return count_; }
  /// Largest latency, us; none without reports.
  std::optional<std::int64_t> max_us() const { return max_us_; }
  /// The latency in us that `fraction` (0 .. 1) of the reports do not exceed. It is exact to 1 us
  /// below 10 ms. Above that it is the largest latency. There is none without reports.
  std::optional<std::int64_t> QuantileUs(double fraction) const;

  /// Share of one core that this process with all its threads has used since construction.
  double CpuPercent() const;
  double WallSeconds() const;

 private:
  static constexpr std::size_t kBuckets = 10000;

  std::array<std::int64_t, kBuckets>
      buckets_{};  // one per us; the last also counts all longer latencies
  std::int64_t count_ = 0;
  std::optional<std::int64_t> max_us_;
  std::int64_t start_us_;
  double start_cpu_s_;
};

}  // namespace torquer::daemon
