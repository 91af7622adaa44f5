#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "host/api/impl.h"
#include "host/simulator/vessel/mesh_check.h"
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
  throw Error(
      fmt::format("mesh_unit = \"{}\" is not a unit of length; give one of: {}", name, known));
}

Surface SurfaceOf(const vessel::TriangleMesh& mesh, const std::vector<std::string>& findings) {
  Surface out{.points_mm = {}, .triangles = mesh.triangles, .findings = findings, .space = ""};
  for (const Eigen::Vector3d& point : mesh.vertices_mm) out.points_mm.push_back(ToPoint(point));
  return out;
}

Surface SurfaceOf(const vessel::SurfaceMesh& from) {
  return SurfaceOf(from.mesh, from.report.findings);
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
    mesh.vertices_mm.emplace_back(vessel::UnitOf(unit).mm * point);
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

Surface Scene::surface() const {
  const vessel::Vessel& vessel = impl_->scene->vessel();
  if (vessel.surface != nullptr) return SurfaceOf(vessel.surface->mesh(), vessel.findings);
  throw Error(path() + ": vessel.kind = \"" + impl_->scene->spec().vessel.kind +
              "\": has no surface of triangles; use a scene with kind = \"surface\"");
}

SurfaceCheck CheckSurface(const std::string& path) {
  return Guarded([&] {
    const vessel::MeshCheck check = vessel::CheckMesh(vessel::ReadMeshContents(path), path);
    return SurfaceCheck{.is_usable = check.surface.has_value(),
                        .text = vessel::DescribeCheck(check),
                        .proposal = vessel::ProposeScene(check)};
  });
}

}  // namespace torquer
