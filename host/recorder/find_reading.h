// Readings of a message by their names.
#pragma once

#include <optional>
#include <string>

#include "torquer_lcm/readings_t.hpp"

namespace torquer {

/// Value of a reading, such as "wall_force_sum_mN". Returns nullopt if the scene has no observer
/// for it, or if the value is unknown or beyond Series::kMost.
std::optional<double> FindReading(const torquer_lcm::readings_t& readings, const std::string& name);

/// Value of a reading, such as "air_kerma_mGy", plus the value of the second plane if it has one:
/// "lateral_air_kerma_mGy". Returns nullopt if one of both is unknown.
std::optional<double> FindOverPlanes(const torquer_lcm::readings_t& readings,
                                     const std::string& name);

}  // namespace torquer
