// Box made of triangles.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Box whose sides are grids of n x n squares.
inline TriangleMesh MakeBox(const Eigen::AlignedBox3d& box, int n) {
  TriangleMesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {0, 1}) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      const auto first = static_cast<int32_t>(mesh.vertices_mm.size());
      for (int j = 0; j <= n; ++j) {
        for (int i = 0; i <= n; ++i) {
          Eigen::Vector3d share;
          share[axis] = side;
          share[u] = static_cast<double>(i) / n;
          share[v] = static_cast<double>(j) / n;
          mesh.vertices_mm.emplace_back(box.min() + share.cwiseProduct(box.sizes()));
        }
      }
      for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) {
          const int32_t a = first + j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
          if (side == 1) {
            mesh.triangles.push_back({a, b, d});
            mesh.triangles.push_back({a, d, c});
          } else {
            mesh.triangles.push_back({a, d, b});
            mesh.triangles.push_back({a, c, d});
          }
        }
      }
    }
  }
  return mesh;
}

}  // namespace torquer::vessel
