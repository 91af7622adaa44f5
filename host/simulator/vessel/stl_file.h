// STL file: triangles from text and binary files. Accepts common variants: capitals, a blank first
// line, several solids, or a few bytes behind the triangles.
#pragma once

#include <string>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Triangles of an STL file; vertices are not welded. `path` names the file in messages. Throws
/// UserError naming file, place and remedy if the file is cut short or no STL. Takes time in
/// proportion to the file's size.
TriangleMesh ParseStl(const std::string& contents, const std::string& path, double mm_per_unit);

}  // namespace torquer::vessel
