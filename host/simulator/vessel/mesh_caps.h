// Closes the ends of a vessel and the holes in its wall.
#pragma once

#include <string>

#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel::repair {

/// Closes every boundary loop with a fan about its center. Loops that look like ends of tubes are
/// openings: flat, round, across the wall about them. Others are holes in the wall. Throws
/// UserError if a hole exceeds largest_hole_share of the surface's area, or all holes exceed five
/// times that.
void CapLoops(TriangleMesh& mesh, const std::string& name, double largest_hole_share,
              MeshReport& report);

}  // namespace torquer::vessel::repair
