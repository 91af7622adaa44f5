// Unit of a reading or of a field of a state, by its name.
#pragma once

#include <array>
#include <string_view>
#include <utility>

namespace torquer {

/// A name ends with its unit. "_" in a unit means "times", but "per" in a load, a speed or a rate.
/// Returns "1" for a name without a unit.
constexpr std::string_view UnitOfName(std::string_view name) {
  // A name takes the first ending that fits.
  constexpr std::array<std::pair<std::string_view, std::string_view>, 19> kUnits = {{
      {"_load_mN_mm", "mN/mm"},
      {"_speed_mm_s", "mm/s"},
      {"_rate_mL_s", "mL/s"},
      {"_per_min", "1/min"},
      {"_mN_mm", "mN mm"},
      {"_Gy_cm2", "Gy cm2"},
      {"_mNs", "mN s"},
      {"_mN", "mN"},
      {"_mm", "mm"},
      {"_um", "um"},
      {"_rad", "rad"},
      {"_mJ", "mJ"},
      {"_us", "us"},
      {"_s", "s"},
      {"_mGy", "mGy"},
      {"_mL", "mL"},
      {"_mg", "mg"},
      {"_kPa", "kPa"},
      {"_mmHg", "mmHg"},
  }};
  for (const auto& [ending, unit] : kUnits) {
    if (name.ends_with(ending)) return unit;
  }
  return "1";
}

}  // namespace torquer
