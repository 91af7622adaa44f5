// A surface cut along the curves where it passes through itself or lies on itself.
#pragma once

#include <optional>

#include "host/simulator/vessel/triangle_bvh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// The same surface in triangles none of which passes through another one: they meet in whole
/// edges, or lie on one another as a whole. Triangles that touch no other stay as they are, and
/// vertices within tolerance_mm (above 0) of one another are one.
///
/// Every triangle is cut by the planes of those that pass through it, and, where two lie in one
/// plane, by the other's edges. None where so many pass through so many that the pieces would be
/// beyond number: that is no surface.
std::optional<TriangleMesh> SplitAtIntersections(const TriangleBvh& surface, double tolerance_mm);

}  // namespace torquer::vessel
