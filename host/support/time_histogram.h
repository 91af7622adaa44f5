// How long something took, over a run of any length, in a room that does not grow.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace torquer {

/// Counts times in bins that are 2 % wide, from 0.1 us to 15 minutes.
class TimeHistogram {
 public:
  /// >= 0; what is beyond the bins counts in the first or the last.
  void Add(double us) {
    ++counts_[BinOf(us)];
    ++count_;
    largest_us_ = std::max(largest_us_, us);
  }
  std::int64_t count() const { return count_; }
  /// The largest, exactly; 0 where there is none.
  double largest_us() const { return largest_us_; }
  /// The smallest time that a share of 0 < `share` <= 1 of all does not exceed (nearest rank), to
  /// 1 %; 0 where there is none.
  double Quantile(double share) const {
    const auto rank = std::max<std::int64_t>(
        1, static_cast<std::int64_t>(std::ceil(share * static_cast<double>(count_))));
    std::int64_t below = 0;
    for (std::size_t bin = 0; bin < kBins; ++bin) {
      below += counts_[bin];
      // The bin's middle, in the logarithm.
      if (below >= rank) return std::min(kLeastUs * std::pow(kRatio, bin + 0.5), largest_us_);
    }
    return 0;
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
  double largest_us_ = 0;
};

}  // namespace torquer
