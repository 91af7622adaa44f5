#include "host/simulator/vessel/surface_regions.h"

#include <algorithm>
#include <cmath>

#include "host/simulator/vessel/mesh_edges.h"
#include "host/simulator/vessel/mesh_repair.h"

namespace torquer::vessel {

using Eigen::Vector3d;

namespace {

// True if a face is too narrow for its middle to distinguish its sides.
bool IsNarrow(const TriangleMesh& mesh, size_t face) {
  constexpr double kNarrow = 1e-3;
  double longest = 0;
  for (int c = 0; c < 3; ++c) {
    longest = std::max(longest, (mesh.Corner(face, (c + 1) % 3) - mesh.Corner(face, c)).norm());
  }
  return mesh.DoubleArea(face).norm() < kNarrow * longest * longest;
}

}  // namespace

Vector3d StepOut(const TriangleMesh& mesh, size_t face) {
  const Vector3d twice = mesh.DoubleArea(face);
  const double area = twice.norm();
  return 1e-4 * std::sqrt(area) * twice / area;
}

std::vector<SurfaceRegion> RegionsOf(const TriangleMesh& mesh) {
  const EdgeTable edges(mesh);
  int count = 0;
  const std::vector<int> part = repair::Parts(mesh, edges, &count);
  std::vector<SurfaceRegion> regions(static_cast<size_t>(count));
  std::vector<char> meets_others(mesh.vertices_mm.size(), 0);
  for (const auto& [edge, uses] : edges) {
    if (uses.size() != 2) meets_others[edge.first] = meets_others[edge.second] = 1;
    if (Balance(uses) == 0) continue;
    for (const EdgeUse& use : uses) regions[part[use.triangle]].is_bounded = true;
  }
  std::vector<double> areas_mm2(part.size());
  for (size_t i = 0; i < part.size(); ++i) {
    SurfaceRegion& region = regions[part[i]];
    areas_mm2[i] = AreaOf(mesh, i);
    region.faces.push_back(static_cast<int32_t>(i));
    const auto& corners = mesh.triangles[i];
    if (!IsNarrow(mesh, i) && std::any_of(corners.begin(), corners.end(),
                                          [&](int32_t v) { return meets_others[v] != 0; })) {
      region.rim.push_back(static_cast<int32_t>(i));
    }
  }
  for (SurfaceRegion& region : regions) {
    std::stable_sort(region.faces.begin(), region.faces.end(),
                     [&](int32_t a, int32_t b) { return areas_mm2[a] > areas_mm2[b]; });
  }
  return regions;
}

TriangleMesh Part(const TriangleMesh& mesh, const std::vector<char>& keep, bool kept) {
  TriangleMesh part;
  part.vertices_mm = mesh.vertices_mm;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    if ((keep[i] != 0) == kept) part.triangles.push_back(mesh.triangles[i]);
  }
  repair::DropUnusedVertices(part);
  return part;
}

}  // namespace torquer::vessel
