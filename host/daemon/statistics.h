// How long the daemon takes from a report's arrival to its command, and what of the processor.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace torquer::daemon {

class Statistics {
 public:
  Statistics();

  /// A report that arrived `us` before its command was on the bus.
  void AddLatency(std::int64_t us);

  std::int64_t count() const { return count_; }
  std::int64_t max_us() const { return max_us_; }
  /// The latency that `fraction` (0 .. 1) of the reports stay within, us, to 1 us below 10 ms; the
  /// largest one beyond; 0 without reports.
  std::int64_t QuantileUs(double fraction) const;

  /// Of one core, by this process with all its threads, since construction.
  double CpuPercent() const;
  double WallSeconds() const;

 private:
  static constexpr std::size_t kBuckets = 10000;

  std::array<std::int64_t, kBuckets> buckets_{};  // by whole us; the last holds all beyond
  std::int64_t count_ = 0;
  std::int64_t max_us_ = 0;
  std::int64_t start_us_;
  double start_cpu_s_;
};

}  // namespace torquer::daemon
