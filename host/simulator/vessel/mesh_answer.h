// What torquer-mesh-reader answers on its standard output: a mesh, or why there is none.
//
//   'M', vertices (8 bytes), triangles (8 bytes), 3 doubles a vertex, 3 indices of 4 bytes a
//   triangle 'R', the refusal as text
//
// Native byte order: reader and asker are of one machine and one build.
#pragma once

#include <string>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

std::string MeshAnswer(const TriangleMesh& mesh);
std::string RefusalAnswer(const std::string& refusal);

/// The mesh of an answer, which may be anything: another program wrote it that may have been taken
/// over by the file. `path` names the file in messages. Throws UserError with the refusal, made
/// printable, or where the answer is cut short, names a vertex that is not there or has a
/// coordinate that is not finite.
TriangleMesh MeshOfAnswer(const std::string& answer, const std::string& path);

}  // namespace torquer::vessel
