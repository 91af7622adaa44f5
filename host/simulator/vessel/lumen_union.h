// Lumen union: one lumen from a surface that passes through itself.
#pragma once

#include <string>

#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Reduces a surface to the wall of everything that it encloses. Inside means a generalized winding
/// number (Jacobson et al. 2013) of 1 or more. Walls within the lumen are removed: walls of
/// overlapping or nested parts, or of a surface that passes through itself. Sheets, which enclose
/// no volume, are removed too: membranes and fins on edges of three faces. The report names the
/// removed parts and drops openings within the lumen.
///
/// surface.mesh: closed except for such sheets, normals outward in each part. Unchanged if no wall
/// is removed. Otherwise, the removed faces are added to surface.left_out.
///
/// Throws UserError that begins with `name` in these cases. More than 5 % of the surface encloses a
/// volume inside out. More than 30 % are sheets. More than 1 % does not separate inside from
/// outside. Faces pass through one another nearly everywhere. The surface encloses no lumen.
void Unite(SurfaceMesh& surface, const std::string& name);

}  // namespace torquer::vessel
