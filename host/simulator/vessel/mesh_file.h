// Triangles from STL, OBJ and PLY files. The library that reads them is not to be trusted with
// files from anywhere: programs call ImportMesh (mesh_import.h), which does this in another
// process.
#pragma once

#include <string>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// The triangles of a surface file, as ImportMesh gives them. Throws UserError as it does, but ends
/// by a signal, never, or out of memory on some damaged files.
TriangleMesh ParseMesh(const std::string& contents, const std::string& path, double mm_per_unit);

}  // namespace torquer::vessel
