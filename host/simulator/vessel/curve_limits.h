// Curve limits: each end of a centerline is compared with each curve, which limits their number.
#pragma once

#include <cstddef>

namespace torquer::vessel {

/// Largest number of curves of a vessel.
inline constexpr std::size_t kMostCurves = 1000;
/// Largest total length of a vessel's curves, mm. A body's named arteries have about 10,000 mm.
inline constexpr double kMostCurvesMm = 50'000;

}  // namespace torquer::vessel
