// One lumen from a surface that passes through itself.
#pragma once

#include <string>

#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Makes the wall of everything that a surface encloses: inside is where its generalized winding
/// number (Jacobson et al. 2013) is 1 or more. Walls within the lumen, from parts that overlap or
/// lie within others or from a surface that passes through itself, go; so do sheets that enclose
/// nothing: membranes and fins on edges of three faces. The report says what went, and openings
/// that end within the lumen are no ends any more.
///
/// surface.mesh: closed but for such sheets, normals outward by parts. Unchanged where no wall has
/// to go; where one has, the faces that go are added to surface.left_out.
///
/// Throws UserError that begins with `name` where more than 5 % of the surface encloses something
/// the wrong way round, more than 1 % does not separate inside from outside, or faces pass through
/// one another nearly everywhere.
void Unite(SurfaceMesh& surface, const std::string& name);

}  // namespace torquer::vessel
