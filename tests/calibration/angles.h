// Conversion of angles to the units that calibration uses.
#pragma once

#include <numbers>

namespace torquer::test {

constexpr double kTurn_rad = 2 * std::numbers::pi;
constexpr double kDegree_rad = std::numbers::pi / 180;

}  // namespace torquer::test
