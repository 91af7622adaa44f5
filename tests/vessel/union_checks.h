// Boxes, and a check of a union of closed parts.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <vector>

#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/triangle_bvh.h"
#include "host/simulator/vessel/triangle_mesh.h"
#include "tests/support/sanitizer.h"
#include "tests/vessel/field_checks.h"

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

/// Checks that a point is inside exactly if it is inside a part. Outside, the distance must be that
/// to the nearest wall of any part.
inline void CheckIsUnionOf(const SurfaceMesh& surface, const std::vector<TriangleMesh>& parts,
                           Random& random, double tolerance_mm = 1e-4) {
  const TriangleBvh whole(surface.mesh);
  std::vector<TriangleBvh> single(parts.begin(), parts.end());
  Eigen::AlignedBox3d box = surface.mesh.Bounds();
  box.extend(box.min() - Eigen::Vector3d::Constant(1));
  box.extend(box.max() + Eigen::Vector3d::Constant(1));
  int inside = 0, wrong = 0;
  double furthest = 0;
  for (int k = 0; k < test::Rounds(500, 5); ++k) {
    const Eigen::Vector3d at = random.InBox(box.min(), box.max());
    double most = -1e9;
    for (const TriangleBvh& part : single) most = std::max(most, part.Distance(at));
    if (std::abs(most) < 2e-3) continue;
    const double distance = whole.Distance(at);
    inside += most > 0 ? 1 : 0;
    wrong += (distance > 0) != (most > 0) ? 1 : 0;
    // Inside, the wall of a part may lie within another part: the clearance may be larger, never
    // smaller.
    if (most < 0) furthest = std::max(furthest, std::abs(distance - most));
    if (most > 0) furthest = std::max(furthest, most - distance);
  }
  CHECK(inside > test::Rounds(5, 5));
  CHECK(wrong == 0);
  CHECK(furthest < tolerance_mm);
}

}  // namespace torquer::vessel
