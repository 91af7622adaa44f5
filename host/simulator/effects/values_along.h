// Values along an instrument, given at distances from its tip.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace torquer::effects {

/// Piecewise linear function of the distance from an instrument's tip. Constant before the first
/// and beyond the last distance.
class ValuesAlong {
 public:
  /// `value`: at all distances.
  explicit ValuesAlong(double value) : from_tip_mm_{0}, values_{value} {}
  /// `from_tip_mm`: ascending distances; `values`: one for all of them, or one for each. Neither is
  /// empty.
  ValuesAlong(std::vector<double> from_tip_mm, std::vector<double> values)
      : from_tip_mm_(std::move(from_tip_mm)), values_(std::move(values)) {}

  double At(double from_tip_mm) const {
    if (values_.size() == 1 || from_tip_mm <= from_tip_mm_.front()) return values_.front();
    if (from_tip_mm >= from_tip_mm_.back()) return values_.back();
    const auto next = std::lower_bound(from_tip_mm_.begin(), from_tip_mm_.end(), from_tip_mm);
    const auto k = static_cast<std::size_t>(next - from_tip_mm_.begin());
    if (*next == from_tip_mm) return values_[k];
    const double t = (from_tip_mm - from_tip_mm_[k - 1]) / (*next - from_tip_mm_[k - 1]);
    return values_[k - 1] + t * (values_[k] - values_[k - 1]);
  }

 private:
  std::vector<double> from_tip_mm_;
  std::vector<double> values_;
};

}  // namespace torquer::effects
