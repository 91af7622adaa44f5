// Pixels of a picture that a straight piece of a wire or vessel may cover.
#pragma once

#include <algorithm>
#include <cmath>

namespace torquer::effects {

/// Minimum distance of a drawn point from the source, mm.
inline constexpr double kNearestMm = 10;

/// Narrows [low, high] to the range with a + b t <= 0.
inline void Narrow(double a, double b, double& low, double& high) {
  if (b > 1e-12) {
    high = std::min(high, -a / b);
  } else if (b < -1e-12) {
    low = std::max(low, -a / b);
  } else if (a > 0) {
    high = low - 1;
  }
}

/// Columns of a row covered by an oriented rectangle about a line on the picture.
struct Band {
  double column, row;  ///< start of the line
  double along_column, along_row;
  double from, to, half_width;  ///< along the line and across it, pixels

  /// Returns false if no column is covered.
  bool Columns(int at_row, int width, int& first, int& last) const {
    const double y = at_row - row;
    double low = -column;
    double high = width - 1 - column;
    Narrow(y * along_row - to, along_column, low, high);
    Narrow(from - y * along_row, -along_column, low, high);
    Narrow(y * along_column - half_width, -along_row, low, high);
    Narrow(-y * along_column - half_width, along_row, low, high);
    if (!(low <= high)) return false;
    first = std::max(0, static_cast<int>(std::ceil(low + column)));
    last = std::min(width - 1, static_cast<int>(std::floor(high + column)));
    return first <= last;
  }
  /// Range of rows that may be covered.
  void Rows(int height, int& first, int& last) const {
    const double side = half_width * std::abs(along_column);
    const double a = row + from * along_row;
    const double b = row + to * along_row;
    first = std::max(0, static_cast<int>(std::ceil(std::min(a, b) - side)));
    last = std::min(height - 1, static_cast<int>(std::floor(std::max(a, b) + side)));
  }
};

}  // namespace torquer::effects
