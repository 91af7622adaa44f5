#include "host/simulator/vessel/flat_ends.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "host/simulator/vessel/mesh_edges.h"

namespace torquer::vessel {

using Eigen::Vector3d;

namespace {

// Smaller parts are not ends of vessels.
constexpr double kSmallestEndMm = 0.4;
// Least cosine between two faces of one flat part: 2 degrees.
constexpr double kFlat = 0.9994;
// Largest square of a rim's length over that of a circle of the same area. An ellipse of 3 to 1 has
// 1.5, no triangle less than 1.65.
constexpr double kEndRoundness = 1.6;
// Largest mean cosine between an end and the wall about it.
constexpr double kLikeEnd = 0.7;

// Flat part of a surface, with sums over its faces and its rim.
struct FlatPart {
  Vector3d area_mm2 = Vector3d::Zero(), moment = Vector3d::Zero();
  double face_mm2 = 0, rim_mm = 0, alike_mm = 0;

  bool IsEnd() const {
    const double mm2 = area_mm2.norm();
    return mm2 >= M_PI * kSmallestEndMm * kSmallestEndMm &&
           rim_mm * rim_mm <= 4 * M_PI * kEndRoundness * mm2 && alike_mm <= kLikeEnd * rim_mm;
  }
};

}  // namespace

std::vector<Opening> FindFlatEnds(const TriangleMesh& mesh) {
  const size_t count = mesh.triangles.size();
  std::vector<Vector3d> normals;
  for (size_t i = 0; i < count; ++i) normals.push_back(mesh.DoubleArea(i).normalized());
  const EdgeTable edges(mesh);
  std::vector<int32_t> parent(count);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const auto& [edge, uses] : edges) {
    if (uses.size() != 2) continue;
    const int32_t one = uses[0].triangle, two = uses[1].triangle;
    if (normals[one].dot(normals[two]) >= kFlat) parent[root(one)] = root(two);
  }
  std::vector<FlatPart> parts(count);
  for (size_t i = 0; i < count; ++i) {
    FlatPart& part = parts[root(static_cast<int32_t>(i))];
    const Vector3d twice = mesh.DoubleArea(i);
    part.area_mm2 += twice / 2;
    part.face_mm2 += twice.norm() / 2;
    part.moment += twice.norm() / 2 * mesh.Centroid(i);
  }
  for (const auto& [edge, uses] : edges) {
    if (uses.size() != 2 || root(uses[0].triangle) == root(uses[1].triangle)) continue;
    const double length = (mesh.vertices_mm[edge.second] - mesh.vertices_mm[edge.first]).norm();
    for (const auto& use : uses) {
      FlatPart& part = parts[root(use.triangle)];
      part.rim_mm += length;
      part.alike_mm += length * normals[uses[0].triangle].dot(normals[uses[1].triangle]);
    }
  }
  std::vector<Opening> ends;
  for (const FlatPart& part : parts) {
    if (!part.IsEnd()) continue;
    const Vector3d outward = part.area_mm2.normalized();
    ends.push_back(
        {part.moment / part.face_mm2, outward, std::sqrt(part.area_mm2.norm() / M_PI), -outward});
  }
  std::stable_sort(ends.begin(), ends.end(),
                   [](const Opening& a, const Opening& b) { return a.radius_mm > b.radius_mm; });
  return ends;
}

}  // namespace torquer::vessel
