// Surface split: cuts a surface along the curves at which it passes through or lies on itself.
#pragma once

#include <optional>

#include "host/simulator/vessel/triangle_bvh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Splits a surface into triangles that do not pass through one another. They meet in whole edges,
/// or lie on one another completely. Triangles that touch no other stay as they are. Vertices
/// within twice tolerance_mm (above 0) of one another are merged.
///
/// Every triangle is cut by the planes of those that pass through it. Triangles in one plane are
/// cut by each other's edges. Returns nullopt for too many cuts or pieces, because the input is
/// then not a surface.
std::optional<TriangleMesh> SplitAtIntersections(const TriangleBvh& surface, double tolerance_mm);

}  // namespace torquer::vessel
