// Closes the ends of a vessel and the holes in its wall.
#pragma once

#include <string>

#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel::repair {

/// Closes every boundary loop with a fan about its center. Loops that look like ends of tubes
/// (flat, round, across the wall about them) are openings, others holes in the wall. Throws on a
/// hole of more than largest_hole_share of the surface's area, and on five times as much in all
/// holes.
void CapLoops(TriangleMesh& mesh, const std::string& name, double largest_hole_share,
              MeshReport& report);

}  // namespace torquer::vessel::repair
