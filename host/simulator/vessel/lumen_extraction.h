// From a vessel's wall with thickness, as printed models have it, to the lumen within.
#pragma once

#include "host/simulator/vessel/triangle_bvh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Share of a surface's area that looks into a tube: whose outward rays nearly all meet the surface
/// again. Near 0 for a lumen, near 0.4 for a wall with thickness. From a sample of the faces.
double TubeFacingShare(const TriangleBvh& surface);

/// The inner side of a wall with thickness: its faces that look into a tube, oriented as the wall
/// of the lumen and open where the vessel is. Empty where none do.
///
/// Rays from every face vote on where it looks, the votes are averaged among neighbors, and islands
/// of the one side within the other are given up.
TriangleMesh InnerSide(const TriangleBvh& surface);

}  // namespace torquer::vessel
