#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "host/api/parts.h"
#include "host/simulator/vessel/mesh_import.h"
#include "host/simulator/vessel/patient_space.h"
#include "host/simulator/vessel/surface_mesh.h"
#include "host/support/error.h"

namespace torquer {

namespace {

vessel::MeshUnit UnitNamed(const std::string& name) {
  std::string known;
  for (std::size_t k = 0; k < vessel::kLengthUnits.size(); ++k) {
    if (vessel::kLengthUnits[k].name == name) return static_cast<vessel::MeshUnit>(k);
    known += (known.empty() ? "" : ", ") + std::string(vessel::kLengthUnits[k].name);
  }
  throw Error(fmt::format("mesh_unit = \"{}\" is no unit of length; give one of: {}", name, known));
}

Surface SurfaceOf(vessel::SurfaceMesh from) {
  Surface out;
  for (const Eigen::Vector3d& point : from.mesh.vertices_mm) {
    out.points_mm.push_back(ToPoint(point));
  }
  out.triangles = std::move(from.mesh.triangles);
  out.findings = std::move(from.report.findings);
  return out;
}

}  // namespace

Surface Surface::FromFile(const std::string& path, const std::string& mesh_unit) {
  const vessel::MeshUnit unit = UnitNamed(mesh_unit);
  return Guarded([&] {
    const std::string contents = vessel::ReadMeshContents(path);
    Surface out = SurfaceOf(vessel::ParseSurface(contents, path, unit));
    if (const auto space = vessel::SpaceOfSurface(contents)) out.space = vessel::NameOf(*space);
    return out;
  });
}

Surface Surface::FromTriangles(const std::vector<Point>& points,
                               const std::vector<std::array<std::int32_t, 3>>& triangles,
                               const std::string& name, const std::string& mesh_unit) {
  const vessel::MeshUnit unit = UnitNamed(mesh_unit);
  vessel::TriangleMesh mesh;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Eigen::Vector3d point(points[k][0], points[k][1], points[k][2]);
    if (!point.allFinite()) {
      throw Error(fmt::format("{}: point {} is not finite; repair the surface", name, k));
    }
    mesh.vertices_mm.push_back(vessel::UnitOf(unit).mm * point);
  }
  const auto count = static_cast<std::int64_t>(points.size());
  for (std::size_t k = 0; k < triangles.size(); ++k) {
    for (const std::int32_t corner : triangles[k]) {
      if (corner >= 0 && corner < count) continue;
      throw Error(fmt::format("{}: triangle {} names point {}; there are points 0 to {}", name, k,
                              corner, count - 1));
    }
  }
  mesh.triangles = triangles;
  return Guarded([&] { return SurfaceOf(vessel::RepairSurface(std::move(mesh), name, unit)); });
}

}  // namespace torquer
