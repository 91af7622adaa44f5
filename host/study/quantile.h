#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace torquer::study {

/// Value that a fraction of the values does not exceed; 0 without values.
inline double Quantile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(fraction * static_cast<double>(values.size() - 1))];
}

}  // namespace torquer::study
