#include "host/simulator/effects/imaging/wedge_filters.h"

#include <algorithm>
#include <cmath>

#include "host/support/angles.h"

namespace torquer::effects {

WedgeShadows::WedgeShadows(const Imaging& imaging, double aspect) {
  for (std::size_t k = 0; k < edges_.size(); ++k) {
    const Wedge& wedge = imaging.wedges[k];
    if (wedge.share <= 0) continue;
    // In widths of the picture from its middle; rows go down, so this turn is clockwise. The plate
    // comes from the side opposite to `x, y`.
    const double side = k == 0 ? 1 : -1;
    const double x = side * std::cos(kRadPerDeg * wedge.rotation_deg);
    const double y = side * std::sin(kRadPerDeg * wedge.rotation_deg);
    const double span = std::abs(x) + aspect * std::abs(y);  // of the picture along `x, y`
    // The plate and its ramp are rigid, so they are wider in a narrower field.
    const double ramp = kRamp * imaging.magnification;
    edges_[k] = {.is_in = true,
                 .across = -x / ramp,
                 .down = -aspect * y / ramp,
                 .edge = -(0.5 * (x + aspect * y) + span * (wedge.share - 0.5)) / ramp};
    any_ = true;
  }
}

double WedgeShadows::IntegralAt(double column_share, double row_share) const {
  double integral = 0;
  for (const Edge& edge : edges_) {
    if (!edge.is_in) continue;
    const double depth = edge.across * column_share + edge.down * row_share - edge.edge;
    integral += kFullIntegral * std::clamp(depth, 0.0, 1.0);
  }
  return integral;
}

void WedgeShadows::Fill(Plane& plane) const {
  for (int row = 0; row < plane.height; ++row) {
    for (int column = 0; column < plane.width; ++column) {
      plane.At(column, row) =
          static_cast<float>(IntegralAt((column + 0.5) / plane.width, (row + 0.5) / plane.height));
    }
  }
}

double WedgeShadows::MeanTransmission(const Imaging& imaging) const {
  if (!any_) return 1;
  constexpr int kCells = 64;  // in each direction; the error is below 1e-3
  const double width = 1 - imaging.left - imaging.right;
  const double height = 1 - imaging.top - imaging.bottom;
  double sum = 0;
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      sum += std::exp(-IntegralAt(imaging.left + width * (column + 0.5) / kCells,
                                  imaging.top + height * (row + 0.5) / kCells));
    }
  }
  return sum / (kCells * kCells);
}

}  // namespace torquer::effects
