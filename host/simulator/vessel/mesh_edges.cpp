#include "host/simulator/vessel/mesh_edges.h"

#include <algorithm>

namespace torquer::vessel {

std::map<Edge, std::vector<EdgeUse>> EdgesOf(const TriangleMesh& mesh) {
  std::map<Edge, std::vector<EdgeUse>> edges;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const int32_t a = mesh.triangles[i][corner], b = mesh.triangles[i][(corner + 1) % 3];
      edges[std::minmax(a, b)].push_back({static_cast<int32_t>(i), corner, a < b});
    }
  }
  return edges;
}

}  // namespace torquer::vessel
