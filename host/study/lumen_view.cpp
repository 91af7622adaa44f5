#include "host/study/lumen_view.h"

#include <algorithm>
#include <cmath>

namespace torquer::study {
namespace {

// True if there is lumen at some z for this x and y. A point at distance c outside the lumen has no
// lumen within c, which allows large steps.
bool InView(const ClearanceField& field, const Eigen::AlignedBox3d& bounds_mm, double x_mm,
            double y_mm, double step_mm) {
  double z_mm = bounds_mm.min()[2];
  while (z_mm <= bounds_mm.max()[2]) {
    const double clearance_mm = field.Clearance({x_mm, y_mm, z_mm});
    if (clearance_mm >= 0) return true;
    z_mm += std::max(-clearance_mm / field.LipschitzBound(), 0.01 * step_mm);
  }
  return false;
}

}  // namespace

std::vector<LumenRun> SeeLumen(const ClearanceField& field, const Eigen::AlignedBox3d& bounds_mm,
                               double step_mm) {
  std::vector<LumenRun> runs;
  const Eigen::Vector3d& low = bounds_mm.min();
  const int columns = static_cast<int>(std::ceil(bounds_mm.sizes()[0] / step_mm)) + 1;
  const int lines = static_cast<int>(std::ceil(bounds_mm.sizes()[1] / step_mm));
  for (int line = 0; line <= lines; ++line) {
    const double y_mm = low[1] + line * step_mm;
    const auto in_view = [&](double x_mm) { return InView(field, bounds_mm, x_mm, y_mm, step_mm); };
    // Bisection between a point outside and a point inside.
    const auto edge = [&](double outside_mm, double inside_mm) {
      while (std::abs(inside_mm - outside_mm) > 0.01 * step_mm) {
        const double middle_mm = (outside_mm + inside_mm) / 2;
        (in_view(middle_mm) ? inside_mm : outside_mm) = middle_mm;
      }
      return inside_mm;
    };
    bool inside = false;
    for (int column = -1; column <= columns; ++column) {
      const double x_mm = low[0] + column * step_mm;
      if (in_view(x_mm) == inside) continue;
      inside = !inside;
      if (inside) {
        runs.push_back({y_mm, edge(x_mm - step_mm, x_mm), x_mm});
      } else {
        runs.back().to_mm = edge(x_mm, x_mm - step_mm);
      }
    }
  }
  return runs;
}

}  // namespace torquer::study
