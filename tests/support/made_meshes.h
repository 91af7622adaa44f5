// Small generated surfaces for tests.
#pragma once

#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <string>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Tube along +x from 0 to length_mm with outward normals and open ends. Each ring has `around`
/// vertices; the radius is a function of x.
template <typename Radius>
TriangleMesh MakeTubeMesh(double length_mm, int along, int around, Radius radius) {
  TriangleMesh mesh;
  for (int i = 0; i <= along; ++i) {
    const double x = length_mm * i / along;
    for (int j = 0; j < around; ++j) {
      const double angle = 2 * M_PI * j / around;
      mesh.vertices_mm.emplace_back(x, radius(x) * std::cos(angle), radius(x) * std::sin(angle));
    }
  }
  for (int i = 0; i < along; ++i) {
    for (int j = 0; j < around; ++j) {
      const int32_t a = i * around + j, b = i * around + (j + 1) % around;
      mesh.triangles.push_back({a, b, a + around});
      mesh.triangles.push_back({b, b + around, a + around});
    }
  }
  return mesh;
}

inline TriangleMesh MakeTubeMesh(double length_mm = 40, double radius_mm = 3) {
  return MakeTubeMesh(length_mm, 20, 24, [=](double) { return radius_mm; });
}

/// Closes the two ends of MakeTubeMesh with fans.
inline void CapTubeMesh(TriangleMesh& mesh, int around = 24) {
  const auto last = static_cast<int32_t>(mesh.vertices_mm.size()) - around;
  const auto middle = static_cast<int32_t>(mesh.vertices_mm.size());
  mesh.vertices_mm.emplace_back(mesh.vertices_mm[0].x(), 0, 0);
  mesh.vertices_mm.emplace_back(mesh.vertices_mm[last].x(), 0, 0);
  for (int j = 0; j < around; ++j) {
    const int32_t k = (j + 1) % around;
    mesh.triangles.push_back({k, j, middle});
    mesh.triangles.push_back({last + j, last + k, middle + 1});
  }
}

inline TriangleMesh MakeClosedTube(double length_mm = 40, double radius_mm = 3) {
  TriangleMesh mesh = MakeTubeMesh(length_mm, radius_mm);
  CapTubeMesh(mesh);
  return mesh;
}

inline void TurnInsideOut(TriangleMesh& mesh) {
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
}

/// Wall with thickness around a straight lumen, open at both ends: rims join the inner and outer
/// tube.
inline TriangleMesh MakeShell(double length_mm = 60, double inner_mm = 4, double outer_mm = 6,
                              int rows = 30) {
  constexpr int kAround = 24;
  TriangleMesh mesh = MakeTubeMesh(length_mm, rows, kAround, [=](double) { return outer_mm; });
  TriangleMesh inner = MakeTubeMesh(length_mm, rows, kAround, [=](double) { return inner_mm; });
  TurnInsideOut(inner);
  const auto first = static_cast<int32_t>(mesh.vertices_mm.size());
  Append(mesh, inner);
  const int32_t end = first - kAround;
  for (int32_t j = 0; j < kAround; ++j) {
    const int32_t k = (j + 1) % kAround;
    mesh.triangles.push_back({j, first + j, k});
    mesh.triangles.push_back({k, first + j, first + k});
    mesh.triangles.push_back({end + j, end + k, first + end + j});
    mesh.triangles.push_back({end + k, first + end + k, first + end + j});
  }
  return mesh;
}

inline void WriteObj(const std::string& path, const TriangleMesh& mesh, double units_per_mm = 1) {
  std::ofstream file(path);
  file.precision(9);
  for (const auto& v : mesh.vertices_mm) {
    file << "v " << v.x() * units_per_mm << ' ' << v.y() * units_per_mm << ' '
         << v.z() * units_per_mm << '\n';
  }
  for (const auto& t : mesh.triangles) {
    file << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
  }
}

inline void WritePly(const std::string& path, const TriangleMesh& mesh) {
  std::ofstream file(path);
  file << "ply\nformat ascii 1.0\nelement vertex " << mesh.vertices_mm.size()
       << "\nproperty float x\nproperty float y\nproperty float z\nelement face "
       << mesh.triangles.size() << "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const auto& v : mesh.vertices_mm) file << v.x() << ' ' << v.y() << ' ' << v.z() << '\n';
  for (const auto& t : mesh.triangles) file << "3 " << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
}

inline void WriteBinaryStl(const std::string& path, const TriangleMesh& mesh) {
  std::ofstream file(path, std::ios::binary);
  file << std::string(80, ' ');
  const auto put = [&](const auto& value) {
    file.write(reinterpret_cast<const char*>(&value), sizeof value);
  };
  put(static_cast<uint32_t>(mesh.triangles.size()));
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Eigen::Vector3f normal = mesh.DoubleArea(i).normalized().cast<float>();
    for (int a = 0; a < 3; ++a) put(normal[a]);
    for (int corner = 0; corner < 3; ++corner) {
      const Eigen::Vector3f v = mesh.Corner(i, corner).cast<float>();
      for (int a = 0; a < 3; ++a) put(v[a]);
    }
    put(uint16_t{0});
  }
}

}  // namespace torquer::vessel
