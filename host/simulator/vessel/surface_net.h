// Surface net: the surface of a vessel that is known only as a clearance field.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Triangles along the field's zero level inside `bounds_mm`, by surface nets on cubic cells of
/// `cell_mm` (> 0). Each cell that the surface crosses has a vertex, each crossed grid edge a
/// quadrilateral. Details below a cell's size are lost. Normals point out of the lumen.
///
/// S. F. F. Gibson, "Constrained Elastic Surface Nets", MICCAI 1998 (without the elastic part).
TriangleMesh SurfaceOf(const ClearanceField& field, const Eigen::AlignedBox3d& bounds_mm,
                       double cell_mm);

/// As above, with a cell size that gives about `triangles` triangles.
TriangleMesh SurfaceInAbout(std::size_t triangles, const ClearanceField& field,
                            const Eigen::AlignedBox3d& bounds_mm);

}  // namespace torquer::vessel
