// Angles in which calibration is spoken of.
#pragma once

#include <numbers>

namespace torquer::test {

constexpr double kTurn_rad = 2 * std::numbers::pi;
constexpr double kDegree_rad = std::numbers::pi / 180;

}  // namespace torquer::test
