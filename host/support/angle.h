// Units of angles.
#pragma once

#include <numbers>

namespace torquer {

inline constexpr double kDegreesPerRad = 180.0 / std::numbers::pi;

}  // namespace torquer
