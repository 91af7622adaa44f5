// Units of angles.
#pragma once

#include <numbers>

namespace torquer {

inline constexpr double kRadPerDeg = std::numbers::pi / 180;

}  // namespace torquer
