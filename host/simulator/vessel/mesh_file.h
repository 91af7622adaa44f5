// Triangles from STL, OBJ and PLY files.
#pragma once

#include <string>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// The triangles of a surface file as they stand, times mm_per_unit. Vertices come unwelded,
/// polygons as fans; points and lines are left out. `contents`: the file's bytes; `path` names it
/// in messages, and its ending says the format.
///
/// Throws UserError naming the file and the remedy: not .stl, .obj or .ply, broken or truncated as
/// far as its format tells, without triangles, or with a coordinate that is not finite (naming the
/// vertex).
TriangleMesh ParseMesh(const std::string& contents, const std::string& path, double mm_per_unit);

/// The same of the file at `path`. Throws UserError also when it is missing, unreadable or no
/// ordinary file.
TriangleMesh ReadMeshFile(const std::string& path, double mm_per_unit);

/// The bytes of a surface file, for ParseMesh. Throws as ReadMeshFile.
std::string ReadMeshContents(const std::string& path);

}  // namespace torquer::vessel
