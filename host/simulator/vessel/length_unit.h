// Units of length in files of surfaces and curves.
#pragma once

#include <array>
#include <string_view>

namespace torquer::vessel {

struct LengthUnit {
  std::string_view name;
  double mm;
};

/// In the order of MeshUnit.
inline constexpr std::array<LengthUnit, 5> kLengthUnits = {
    {{"mm", 1}, {"m", 1000}, {"cm", 10}, {"um", 0.001}, {"in", 25.4}}};

}  // namespace torquer::vessel
