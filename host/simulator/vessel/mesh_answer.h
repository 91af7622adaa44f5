// Mesh answer: a mesh or a refusal, which torquer-mesh-reader writes to its standard output.
//
//   'M', vertices (8 bytes), triangles (8 bytes), 3 doubles per vertex, 3 indices of 4 bytes per
//        triangle
//   'R', the refusal as text
//
// Native byte order: both programs run on one machine and belong to one build.
#pragma once

#include <string>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

std::string MeshAnswer(const TriangleMesh& mesh);
std::string RefusalAnswer(const std::string& refusal);

/// Mesh of an answer. The answer is untrusted: the file may have taken over the program that wrote
/// it. `path` names the file in messages. Throws UserError with the refusal, made printable. Also
/// throws if the answer is cut short, has no triangle, a missing vertex or a non-finite coordinate.
TriangleMesh MeshOfAnswer(const std::string& answer, const std::string& path);

}  // namespace torquer::vessel
