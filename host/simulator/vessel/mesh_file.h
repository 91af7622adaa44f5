// Triangles from STL, OBJ and PLY files.
#pragma once

#include <string>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Reads the triangles of a surface file as they stand, times mm_per_unit. Vertices come unwelded,
/// polygons as fans; points and lines are left out.
///
/// Throws UserError naming the file and the remedy: missing, unreadable, not .stl, .obj or .ply,
/// broken or truncated as far as its format tells, without triangles, or with a coordinate that is
/// not finite (naming the vertex).
TriangleMesh ReadMeshFile(const std::string& path, double mm_per_unit);

}  // namespace torquer::vessel
