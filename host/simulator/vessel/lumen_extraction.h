// Lumen extraction: from a wall with thickness, as in printed models, to the lumen inside.
#pragma once

#include "host/simulator/vessel/triangle_bvh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Share of a surface's area that looks into a tube. There, nearly all outward rays meet the same
/// part of the surface again. Near 0 for a lumen, near 0.4 for a wall with thickness. Estimated
/// from a sample of the faces.
double TubeFacingShare(const TriangleBvh& surface);

/// Inner side of a wall with thickness: its faces that look into a tube. They are oriented as the
/// wall of the lumen and open at the vessel's ends. Empty without such faces.
///
/// Rays from every face vote on its side, and neighbors average their votes. Islands of one side
/// within the other change sides.
TriangleMesh InnerSide(const TriangleBvh& surface);

}  // namespace torquer::vessel
