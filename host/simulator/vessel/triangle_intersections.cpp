// Search for the triangles of a mesh that cut through one another.
#include <algorithm>

#include "host/simulator/vessel/triangle_bvh.h"

namespace torquer::vessel {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

namespace {

// True if the segment pq passes through the interior of triangle abc.
bool Pierces(const Vector3d& p, const Vector3d& q, const Vector3d& a, const Vector3d& b,
             const Vector3d& c) {
  const Vector3d normal = (b - a).cross(c - a);
  const double hp = normal.dot(p - a), hq = normal.dot(q - a);
  if ((hp > 0) == (hq > 0) || hp == hq) return false;
  const Vector3d direction = q - p;
  const double u = direction.dot((a - p).cross(b - p)), v = direction.dot((b - p).cross(c - p)),
               w = direction.dot((c - p).cross(a - p));
  return (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
}

}  // namespace

std::vector<std::pair<int32_t, int32_t>> TriangleBvh::FindIntersections(size_t limit) const {
  std::vector<std::pair<int32_t, int32_t>> found;
  std::vector<int32_t> near;
  for (int32_t i = 0; i < static_cast<int32_t>(faces_.size()); ++i) {
    const Vector3d corners[3] = {mesh_.Corner(i, 0), mesh_.Corner(i, 1), mesh_.Corner(i, 2)};
    AlignedBox3d box;
    for (const Vector3d& corner : corners) box.extend(corner);
    FindTouching(box, near);
    for (const int32_t j : near) {
      if (j <= i) continue;
      const auto &one = mesh_.triangles[i], &two = mesh_.triangles[j];
      const bool neighbors = std::any_of(one.begin(), one.end(), [&](int32_t v) {
        return std::find(two.begin(), two.end(), v) != two.end();
      });
      if (neighbors) continue;
      const Vector3d others[3] = {mesh_.Corner(j, 0), mesh_.Corner(j, 1), mesh_.Corner(j, 2)};
      bool cut = false;
      for (int e = 0; e < 3 && !cut; ++e) {
        cut = Pierces(corners[e], corners[(e + 1) % 3], others[0], others[1], others[2]) ||
              Pierces(others[e], others[(e + 1) % 3], corners[0], corners[1], corners[2]);
      }
      if (!cut) continue;
      found.emplace_back(i, j);
      if (found.size() >= limit) return found;
    }
  }
  return found;
}

}  // namespace torquer::vessel
