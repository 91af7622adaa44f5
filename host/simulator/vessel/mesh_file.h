// Mesh file: triangles from STL, OBJ and PLY files. The library is not safe with files from
// anywhere. Programs call ImportMesh (mesh_import.h), which runs this in another process.
#pragma once

#include <string>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Triangles of a surface file, with the arguments and errors of ImportMesh. On some damaged files
/// it ends by a signal, does not end or runs out of memory.
TriangleMesh ParseMesh(const std::string& contents, const std::string& path, double mm_per_unit);

}  // namespace torquer::vessel
