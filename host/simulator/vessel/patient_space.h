// Coordinate systems of patients, which 3D Slicer names in its files.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

namespace torquer::vessel {

/// Left-posterior-superior, or right-anterior-superior: x and y have the other sign.
enum class PatientSpace { kLps, kRas };

/// Space of "LPS" or "RAS"; none for other texts.
inline std::optional<PatientSpace> PatientSpaceOf(std::string_view name) {
  if (name == "LPS") return PatientSpace::kLps;
  if (name == "RAS") return PatientSpace::kRas;
  return std::nullopt;
}

inline const char* NameOf(PatientSpace space) {
  return space == PatientSpace::kLps ? "LPS" : "RAS";
}

/// Space of a surface file's comment or header, "SPACE=LPS" or "SPACE=RAS", if there is one.
inline std::optional<PatientSpace> SpaceOfSurface(std::string_view contents) {
  constexpr std::string_view kSpace = "SPACE=";
  contents = contents.substr(0, 1000);
  const std::size_t at = contents.find(kSpace);
  if (at == std::string_view::npos) return std::nullopt;
  return PatientSpaceOf(contents.substr(at + kSpace.size(), 3));
}

}  // namespace torquer::vessel
