// Samples of a tube field on a grid, for the bricks that are fitted to it.

#include <algorithm>
#include <limits>
#include <vector>

#include "host/simulator/vessel/tube_field.h"

namespace torquer::vessel {

using Eigen::Vector3d;

namespace {

constexpr double kNearMargin_mm = 1e-6;  // rounding of the values in FindNear
constexpr double kLeast = -std::numeric_limits<double>::infinity();

}  // namespace

// Tubes and primitives that Evaluate cannot do without in a ball. Values are nowhere steeper than
// 1: a value at the center bounds those in the ball.
std::vector<TubeField::NearTube> TubeField::FindNear(const Vector3d& center,
                                                     double radius_mm) const {
  const double change_mm = 2 * radius_mm + kNearMargin_mm;  // of the difference of two values
  std::vector<NearTube> near;
  double value = 0;
  std::vector<double> values;
  for (const TubeData& tube : tubes_) {
    values.clear();
    for (const Primitive& primitive : tube.primitives) {
      Contact contact{kLeast, 0, &primitive, false};
      Look(primitive, tube.round_mm, center, contact);
      values.push_back(contact.value);
    }
    const double largest = *std::max_element(values.begin(), values.end());
    const double apart = union_width_mm_ + change_mm;
    if (!near.empty() && largest < value - apart) continue;
    // The earlier tubes have no effect if this tube exceeds them by more than the union width.
    if (!near.empty() && largest > value + apart) near.clear();
    value = near.empty() ? largest : Blend(value, largest);
    near.push_back({tube.round_mm, {}});
    for (size_t i = 0; i < values.size(); ++i) {
      if (values[i] >= largest - change_mm) near.back().primitives.push_back(&tube.primitives[i]);
    }
  }
  return near;
}

void TubeField::SampleGrid(const double* x, const double* y, const double* z, int count,
                           double /*needed_mm*/, double* distances) const {
  const Vector3d low(x[0], y[0], z[0]), high(x[count - 1], y[count - 1], z[count - 1]);
  const std::vector<NearTube> near = FindNear((low + high) / 2, (high - low).norm() / 2);
  for (int k = 0; k < count; ++k) {
    for (int j = 0; j < count; ++j) {
      for (int i = 0; i < count; ++i) {
        const Vector3d p(x[i], y[j], z[k]);
        double value = kLeast;
        for (const NearTube& tube : near) {
          Contact contact{value - union_width_mm_, 0, nullptr, false};
          for (const Primitive* primitive : tube.primitives) {
            Look(*primitive, tube.round_mm, p, contact);
          }
          if (contact.primitive != nullptr) value = Blend(value, contact.value);
        }
        *distances++ = value;
      }
    }
  }
}

}  // namespace torquer::vessel
