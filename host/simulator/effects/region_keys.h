// Regions of the vessel as scenes write them: a ball, a stretch of a centerline or a side of a
// plane.
#pragma once

#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/vessel/region.h"

namespace torquer::effects {

/// Reads a [[effects.NAME.region]] table, all but the keys of the effect itself. Throws UserError
/// where the keys name no region, an unknown centerline, or no part of the vessel.
vessel::Region ReadRegion(StrictTable& keys, const EffectContext& context);

/// The keys that ReadRegion reads, and `more` of the effect's own.
std::vector<OtherKey> RegionKeys(const std::vector<OtherKey>& more);

/// The unit direction of `key`: [x, y, z] in the vessel's frame, or the name of a patient's
/// direction: left, right, anterior, posterior, superior, inferior.
Eigen::Vector3d ReadPatientDirection(StrictTable& keys, const char* key,
                                     const EffectContext& context);

}  // namespace torquer::effects
