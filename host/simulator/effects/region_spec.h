// Region spec: a region of the vessel as written in a scene. It is a ball, a stretch of a
// centerline or a side of a plane.
#pragma once

#include <optional>
#include <string>

#include "host/simulator/effects/effect.h"
#include "host/simulator/vessel/region.h"

namespace torquer::effects {

/// Keys of a [[effects.NAME.region]], without those of the effect itself.
struct RegionSpec : TableSpec {
  std::optional<Eigen::Vector3d> center_mm;  ///< of a ball
  std::optional<double> radius_mm;           ///< of the ball, or about the stretch
  std::optional<std::string> centerline;     ///< of a stretch
  std::optional<double> from_mm;
  std::optional<double> to_mm;
  std::optional<Eigen::Vector3d> side_of_mm;  ///< a point of the plane
  std::optional<DirectionSpec> side;
  std::optional<double> edge_mm;
};

const Keys<RegionSpec>& RegionKeys();

/// Throws UserError if the keys name an unknown centerline, or no part of the vessel.
vessel::Region MakeRegion(const RegionSpec& spec, const EffectContext& context);

}  // namespace torquer::effects
