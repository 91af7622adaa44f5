// Outlets: the ends of a vessel's model, where an instrument leaves it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/vessel/vessel.h"

namespace torquer::vessel {

/// Flat disc across the end of a vessel.
struct Outlet {
  Eigen::Vector3d center_mm;
  Eigen::Vector3d outward;  ///< unit, along the vessel
  double radius_mm = 0;

  /// Distance of a point from the disc.
  double DistanceMm(const Eigen::Vector3d& point_mm) const;
};

/// Outlets of a vessel: the open ends of its surface, otherwise its flat ends. Free ends of its
/// centerlines at another end of the lumen, such as a round one, are outlets too.
std::vector<Outlet> FindOutlets(const Vessel& vessel);

}  // namespace torquer::vessel
