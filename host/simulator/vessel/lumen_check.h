// Whether a wire can begin at a place.
#pragma once

#include <Eigen/Core>
#include <string>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/centerline.h"

namespace torquer::vessel {

/// What stands about a place where a wire is to enter.
struct LumenReport {
  double clearance_mm = 0;  ///< from the place to the wall; negative outside
  bool inside = false;      ///< the place is in the lumen
  bool wire_fits = false;   ///< the wire's whole thickness is
  /// How far a wire could go straight on before its side touches the wall, mm; at most 100.
  double free_way_mm = 0;
  /// Somewhere near that would do: on a centerline if there is one, else up the clearance. NaN
  /// where none was found.
  Eigen::Vector3d suggestion_mm;
  /// Empty where the wire can begin here; else one sentence with the values and the remedy.
  std::string problem;
};

/// direction: unit. wire_radius_mm > 0. centerlines may be empty.
LumenReport CheckPlace(const ClearanceField& field, const CenterlineNetwork& centerlines,
                       const Eigen::Vector3d& point_mm, const Eigen::Vector3d& direction,
                       double wire_radius_mm);

}  // namespace torquer::vessel
