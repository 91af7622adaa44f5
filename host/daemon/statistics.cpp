#include "host/daemon/statistics.h"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>

#include "host/bus/clock.h"

namespace torquer::daemon {
namespace {

double CpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace

Statistics::Statistics() : start_us_(bus::MonotonicUs()), start_cpu_s_(CpuSeconds()) {}

void Statistics::AddLatency(std::int64_t us) {
  const std::int64_t bucket = std::clamp<std::int64_t>(us, 0, kBuckets - 1);
  ++buckets_[static_cast<std::size_t>(bucket)];
  ++count_;
  max_us_ = std::max(max_us_.value_or(us), us);
}

std::optional<std::int64_t> Statistics::QuantileUs(double fraction) const {
  if (count_ == 0) return std::nullopt;
  const auto wanted = static_cast<std::int64_t>(std::ceil(fraction * static_cast<double>(count_)));
  std::int64_t seen = 0;
  for (std::size_t us = 0; us + 1 < kBuckets; ++us) {
    seen += buckets_[us];
    if (seen >= wanted) return static_cast<std::int64_t>(us);
  }
  return max_us_;
}

double Statistics::CpuPercent() const {
  const double wall_s = WallSeconds();
  return wall_s > 0.0 ? 100.0 * (CpuSeconds() - start_cpu_s_) / wall_s : 0.0;
}

double Statistics::WallSeconds() const {
  return 1e-6 * static_cast<double>(bus::MonotonicUs() - start_us_);
}

}  // namespace torquer::daemon
