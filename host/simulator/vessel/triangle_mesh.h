// Triangles with shared vertices.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

namespace torquer::vessel {

struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices_mm;
  /// Vertex indices, counterclockwise seen from outside.
  std::vector<std::array<int32_t, 3>> triangles;

  const Eigen::Vector3d& Corner(size_t triangle, int corner) const {
    return vertices_mm[triangles[triangle][corner]];
  }
  /// Outward normal with twice the area as its length, mm^2.
  Eigen::Vector3d DoubleArea(size_t triangle) const {
    const Eigen::Vector3d& a = Corner(triangle, 0);
    return (Corner(triangle, 1) - a).cross(Corner(triangle, 2) - a);
  }
  Eigen::Vector3d Centroid(size_t triangle) const {
    return (Corner(triangle, 0) + Corner(triangle, 1) + Corner(triangle, 2)) / 3;
  }
  Eigen::AlignedBox3d Bounds() const {
    Eigen::AlignedBox3d box;
    for (const auto& triangle : triangles) {
      for (const int32_t vertex : triangle) box.extend(vertices_mm[vertex]);
    }
    return box;
  }
  double Area() const {
    double sum = 0;
    for (size_t i = 0; i < triangles.size(); ++i) sum += DoubleArea(i).norm() / 2;
    return sum;
  }
  /// Enclosed volume of a closed mesh, mm^3: positive if normals point outward.
  double Volume() const {
    // About a vertex of the mesh rather than the origin, which may be far away.
    const Eigen::Vector3d about = triangles.empty() ? Eigen::Vector3d::Zero() : Corner(0, 0);
    double sum = 0;
    for (size_t i = 0; i < triangles.size(); ++i) {
      sum += (Corner(i, 0) - about).dot((Corner(i, 1) - about).cross(Corner(i, 2) - about));
    }
    return sum / 6;
  }
};

/// Adds another surface, in parts not joined to the first.
inline void Append(TriangleMesh& mesh, const TriangleMesh& other) {
  const auto first = static_cast<int32_t>(mesh.vertices_mm.size());
  mesh.vertices_mm.insert(mesh.vertices_mm.end(), other.vertices_mm.begin(),
                          other.vertices_mm.end());
  for (const auto& t : other.triangles) {
    mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
}

}  // namespace torquer::vessel
