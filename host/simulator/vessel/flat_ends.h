// Flat ends of a closed surface: there, a program capped a vessel that was cut.
#pragma once

#include <vector>

#include "host/simulator/vessel/surface_mesh.h"

namespace torquer::vessel {

/// Flat, round parts of a closed surface with outward normals that the wall meets at an angle,
/// largest first. Both ends of a capped tube are such parts; the panels of a coarse wall are not.
std::vector<Opening> FindFlatEnds(const TriangleMesh& mesh);

}  // namespace torquer::vessel
