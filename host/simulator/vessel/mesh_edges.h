// Edges of a triangle mesh, and the triangles that use them.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Two vertices, the smaller one first.
using Edge = std::pair<int32_t, int32_t>;

/// A triangle's side along an edge.
struct EdgeUse {
  int32_t triangle;
  int corner;    ///< the side runs from this corner to the next
  bool forward;  ///< from the edge's smaller vertex to its larger
};

std::map<Edge, std::vector<EdgeUse>> EdgesOf(const TriangleMesh& mesh);

}  // namespace torquer::vessel
