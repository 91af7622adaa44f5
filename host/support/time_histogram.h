// Distribution of times over a run of any length, in fixed memory.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace torquer {

/// Counts times in bins that are 2 % wide, from 0.1 us to 15 minutes.
class TimeHistogram {
 public:
  /// Adds a time >= 0; times beyond the bins count in the first or the last one.
  void Add(double us) {
    ++counts_[BinOf(us)];
    ++count_;
    largest_us_ = std::max(largest_us_.value_or(us), us);
  }
  std::int64_t count() const { return count_; }
  /// Exact largest time; none if there are no times.
  std::optional<double> largest_us() const { return largest_us_; }
  /// Smallest time that is not exceeded by a share of 0 < `share` <= 1 of all times (nearest rank).
  /// Accurate to 1 %; none if there are no times.
  std::optional<double> Quantile(double share) const {
    const auto rank = std::max<std::int64_t>(
        1, static_cast<std::int64_t>(std::ceil(share * static_cast<double>(count_))));
    std::int64_t below = 0;
    for (std::size_t bin = 0; bin < kBins; ++bin) {
      below += counts_[bin];
      // Logarithmic middle of the bin.
      if (below >= rank) return std::min(kLeastUs * std::pow(kRatio, bin + 0.5), *largest_us_);
    }
    return std::nullopt;
  }

 private:
  static constexpr double kLeastUs = 0.1;
  static constexpr double kRatio = 1.02;
  static constexpr std::size_t kBins = 1160;

  static std::size_t BinOf(double us) {
    if (!(us > kLeastUs)) return 0;
    const double bin = std::log(us / kLeastUs) / std::log(kRatio);
    return std::min(static_cast<std::size_t>(bin), kBins - 1);
  }

  std::array<std::int64_t, kBins> counts_ = {};
  std::int64_t count_ = 0;
  std::optional<double> largest_us_;
};

}  // namespace torquer
