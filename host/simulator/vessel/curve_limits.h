// How many centerlines a vessel may have: each end is compared with each curve.
#pragma once

#include <cstddef>

namespace torquer::vessel {

/// Most curves of a vessel.
inline constexpr std::size_t kMostCurves = 1000;
/// Most length of all its curves together, mm. The named arteries of a body have some 10,000 mm.
inline constexpr double kMostCurvesMm = 50'000;

}  // namespace torquer::vessel
