// Lumen check: decides if a wire can begin at a place, and if centerlines fit the surface.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/distance_source.h"

namespace torquer::vessel {

/// Report on a place for the entry of a wire.
struct LumenReport {
  double clearance_mm = 0;  ///< from the place to the wall; negative outside
  bool inside = false;      ///< the place is in the lumen
  bool wire_fits = false;   ///< the wire's whole thickness is in the lumen
  /// Straight free way of a wire before its side touches the wall, mm; at most 100. 0 if no wire
  /// fits.
  double free_way_mm = 0;
  /// Usable place nearby: on a centerline if there is one, else up the clearance. The place itself
  /// if the wire fits. NaN if the search failed.
  Eigen::Vector3d suggestion_mm;
  /// Empty if the wire can begin here; else one sentence with the values and the remedy.
  std::string problem;
};

/// direction: unit. wire_radius_mm > 0. centerlines may be empty.
LumenReport CheckPlace(const ClearanceField& field, const CenterlineNetwork& centerlines,
                       const Eigen::Vector3d& point_mm, const Eigen::Vector3d& direction,
                       double wire_radius_mm);

/// Shares of a network's length in the lumen of a surface, 0 to 1.
struct SharesInside {
  double as_given = 0;
  double turned = 0;  ///< with the other signs of x and y, as between LPS and RAS
  /// True if the network is in the other coordinate system of patients. Most of it lies outside
  /// then, and nearly all of it inside if it is turned.
  bool IsInOtherSpace() const { return as_given < 0.5 && turned > 0.9; }
};

/// Looks at points each millimeter.
SharesInside FindSharesInside(const CenterlineNetwork& network, const DistanceSource& surface);

/// Radii of a network that do not fit its vessel, as after an error of their unit.
struct WrongRadius {
  bool is_too_large = false;  ///< else most radii are too small
  std::string curve;
  double at_mm = 0;  ///< arc length of the point with the largest radius
  Eigen::Vector3d position_mm;
  double radius_mm = 0;
  double room_mm = 0;  ///< largest distance of the wall from any curve
};

/// Compares the radii with the distances to the wall at points each millimeter. A radius above five
/// times the largest distance is too large; in real vessels the factor is 1.3 to 1.5. Radii are too
/// small if most are below a fifth of the distance there. Curves with less than 20 mm in the lumen
/// are not compared.
std::optional<WrongRadius> FindWrongRadius(const CenterlineNetwork& network,
                                           const DistanceSource& surface);

}  // namespace torquer::vessel
