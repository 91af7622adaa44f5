// The surface of a vessel that is known only as a clearance field.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Triangles along the field's zero level inside `bounds_mm`, from a grid of cubic cells of
/// `cell_mm` by surface nets: a corner in each cell that the surface crosses, a quadrilateral
/// across each grid edge that it crosses. Details below a cell's size are lost. Normals point out
/// of the lumen.
///
/// S. F. F. Gibson, "Constrained Elastic Surface Nets", MICCAI 1998 (without the elastic part).
TriangleMesh SurfaceOf(const ClearanceField& field, const Eigen::AlignedBox3d& bounds_mm,
                       double cell_mm);

/// As above, in cells of a size that gives about `triangles`.
TriangleMesh SurfaceInAbout(std::size_t triangles, const ClearanceField& field,
                            const Eigen::AlignedBox3d& bounds_mm);

}  // namespace torquer::vessel
