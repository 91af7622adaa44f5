#include "host/simulator/vessel/surface_mesh.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "host/simulator/vessel/lumen_extraction.h"
#include "host/simulator/vessel/lumen_union.h"
#include "host/simulator/vessel/mesh_caps.h"
#include "host/simulator/vessel/mesh_import.h"
#include "host/simulator/vessel/mesh_repair.h"
#include "host/simulator/vessel/triangle_bvh.h"
#include "host/support/error.h"

namespace torquer::vessel {

using Eigen::Vector3d;
using repair::Number;
using repair::Place;

namespace {

constexpr double kWeldPerDiagonal = 2e-5;
// Limits of the diagonal: no usable vessel is smaller, no body larger.
constexpr double kSmallestDiagonalMm = 5, kLargestDiagonalMm = 4000;
// Single precision, as in STL, resolves 0.1 mm at this distance.
constexpr double kFarthestMm = 1e6;
// Largest area share of a hole in the wall: one of the file, and one left around the inner side.
constexpr double kFileHoleShare = 0.01, kInnerHoleShare = 0.05;
// Least volume of a lumen, relative to its area to the power 3/2. A tube of 1 m and 0.3 mm has
// 3e-6.
constexpr double kLeastVolume = 1e-8;
// Tube-facing share of the area: from kWallShare on a surface is a wall, up to kLumenShare a lumen.
constexpr double kWallShare = 0.25, kLumenShare = 0.1;

void Close(SurfaceMesh& surface, const std::string& name, double tolerance_mm,
           double largest_hole_share) {
  repair::CapLoops(surface.mesh, name, largest_hole_share, surface.report);
  repair::MendSlivers(surface.mesh, tolerance_mm, surface.report);
  repair::PointOutward(surface.mesh, surface.report);
  repair::CountCrossedEdges(surface.mesh, surface.report);
  Unite(surface, name);
}

bool IsVessel(double diagonal_mm) {
  return diagonal_mm >= kSmallestDiagonalMm && diagonal_mm <= kLargestDiagonalMm;
}

std::string Sizes(const Vector3d& sizes) {
  return Number(sizes.x()) + " x " + Number(sizes.y()) + " x " + Number(sizes.z());
}

// Remedy for a surface of another size than a vessel: each unit that makes it one.
std::string OtherUnits(const Vector3d& file_sizes) {
  std::string units;
  for (const LengthUnit& unit : kLengthUnits) {
    const Vector3d sizes = unit.mm * file_sizes;
    if (!IsVessel(sizes.norm())) continue;
    units += (units.empty() ? "\"" : ", or \"") + std::string(unit.name) + "\" if that is " +
             Sizes(sizes) + " mm";
  }
  return units.empty() ? "scale it to millimeters"
                       : "declare the unit of its coordinates, mesh_unit = " + units;
}

// A flat sheet, closed by its own cap, balances at every edge.
void CheckEncloses(const MeshReport& report, const std::string& name) {
  if (report.volume_mm3 > kLeastVolume * std::pow(report.area_mm2, 1.5)) return;
  throw UserError(name + ": the surface encloses no volume (" + Number(report.volume_mm3) +
                  " mm^3 within " + Number(report.area_mm2) +
                  " mm^2), like a flat sheet; export the lumen's closed surface");
}

// Measures wall-to-wall widths along inward normals, weighted by area.
void MeasureWidth(const TriangleBvh& surface, MeshReport& report) {
  const TriangleMesh& mesh = surface.mesh();
  std::vector<std::pair<double, double>> widths;  // width, area
  double total = 0;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Vector3d twice = mesh.DoubleArea(i);
    const double width = surface.CastRay(mesh.Centroid(i), -twice.normalized(), 1e-6);
    if (!std::isfinite(width)) continue;
    widths.emplace_back(width, twice.norm());
    total += twice.norm();
  }
  std::sort(widths.begin(), widths.end());
  const double shares[3] = {0.05, 0.5, 0.95};
  double sum = 0;
  int next = 0;
  for (const auto& [width, area] : widths) {
    sum += area;
    while (next < 3 && sum >= shares[next] * total) report.width_mm[next++] = width;
  }
}

// Direction of the wall near an opening: the direction across its normals.
Vector3d InwardAxis(const TriangleMesh& mesh, const Opening& opening) {
  Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Vector3d off = mesh.Centroid(i) - opening.center_mm;
    const Vector3d twice = mesh.DoubleArea(i);
    const bool is_cap = std::abs(off.dot(opening.outward)) < 0.3 * opening.radius_mm &&
                        std::abs(twice.normalized().dot(opening.outward)) > 0.9;
    if (is_cap || off.norm() > 3 * opening.radius_mm) continue;
    normals += twice * twice.transpose() / twice.norm();
  }
  const Vector3d axis =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(normals).eigenvectors().col(0);
  return axis.dot(opening.outward) < 0 ? axis : Vector3d(-axis);
}

}  // namespace

const LengthUnit& UnitOf(MeshUnit unit) { return kLengthUnits.at(static_cast<size_t>(unit)); }

std::optional<MeshUnit> GuessUnit(const TriangleMesh& file) {
  const double diagonal = file.Bounds().diagonal().norm();
  for (size_t k = 0; k < kLengthUnits.size(); ++k) {
    if (IsVessel(diagonal * kLengthUnits[k].mm)) return static_cast<MeshUnit>(k);
  }
  return std::nullopt;
}

void CheckSize(const TriangleMesh& mesh, const std::string& name, MeshUnit unit) {
  const Eigen::AlignedBox3d box = mesh.Bounds();
  // The size first: in another unit the distance from the origin is another one, too.
  if (!IsVessel(box.diagonal().norm())) {
    throw UserError(name + ": the surface is " + Sizes(box.sizes()) +
                    " mm, which is not the size of a vessel (diagonal 5 to 4000 mm); " +
                    OtherUnits(box.sizes() / UnitOf(unit).mm));
  }
  const double far_mm = std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff());
  if (far_mm <= kFarthestMm) return;
  throw UserError(name + ": the surface lies " + Number(far_mm) +
                  " mm from the origin, and coordinates beyond 1 km are too coarse for a vessel; "
                  "move it to the origin");
}

double WeldToleranceMm(const TriangleMesh& mesh) {
  return kWeldPerDiagonal * mesh.Bounds().diagonal().norm();
}

SurfaceMesh ReadSurface(const std::string& path, MeshUnit unit) {
  return ParseSurface(ReadMeshContents(path), path, unit);
}

SurfaceMesh ParseSurface(const std::string& contents, const std::string& path, MeshUnit unit) {
  return RepairSurface(ImportMesh(contents, path, UnitOf(unit).mm), path, unit);
}

SurfaceMesh RepairSurface(TriangleMesh raw, const std::string& name, MeshUnit unit) {
  SurfaceMesh surface{std::move(raw), {}, {}};
  TriangleMesh& mesh = surface.mesh;
  MeshReport& report = surface.report;
  report.triangles_read = mesh.triangles.size();
  if (mesh.triangles.empty())
    throw UserError(name + ": the surface has no triangles; export the vessel as a surface mesh");
  CheckSize(mesh, name, unit);
  const double tolerance_mm = WeldToleranceMm(mesh);
  report.findings.push_back(std::to_string(report.triangles_read) + " triangles read.");
  repair::Weld(mesh, tolerance_mm, report);
  repair::DropUseless(mesh, report);
  if (mesh.triangles.empty()) {
    throw UserError(name + ": none of the surface's triangles has an area; export it again");
  }
  repair::DropFragments(mesh, report);
  repair::Orient(mesh, name, report);
  Close(surface, name, tolerance_mm, kFileHoleShare);

  {
    const TriangleBvh closed(mesh, TriangleBvh::Signs::kNone);
    report.tube_facing_share = TubeFacingShare(closed);
    const std::string share = Number(100 * report.tube_facing_share) + " % of the surface";
    if (report.tube_facing_share > kLumenShare && report.tube_facing_share < kWallShare) {
      throw UserError(name + ": " + share +
                      " faces into a tube, so it is neither clearly a lumen (under 10 %) nor a "
                      "wall with thickness (over 25 %); export the lumen's surface alone");
    }
    if (report.tube_facing_share >= kWallShare) {
      report.was_shell = true;
      report.was_inward = false;
      report.openings.clear();
      mesh = InnerSide(closed);
      report.findings.push_back(
          share +
          " faces into a tube: this is a wall with thickness, not a lumen. Its inner side (" +
          std::to_string(mesh.triangles.size()) + " triangles) was taken and closed at its ends.");
      if (mesh.triangles.empty()) {
        throw UserError(name + ": the wall's inner side was not found; export the lumen's surface");
      }
      Close(surface, name, tolerance_mm, kInnerHoleShare);
    }
  }
  std::sort(report.openings.begin(), report.openings.end(),
            [](const Opening& a, const Opening& b) { return a.radius_mm > b.radius_mm; });
  for (Opening& opening : report.openings) {
    opening.inward = InwardAxis(mesh, opening);
    report.findings.push_back("Open end of radius " + Number(opening.radius_mm) + " mm at " +
                              Place(opening.center_mm) + ", direction into the vessel " +
                              repair::Direction(opening.inward) + ": closed flat.");
  }
  const TriangleBvh finished(mesh, TriangleBvh::Signs::kNone);
  MeasureWidth(finished, report);
  report.bounds_mm = mesh.Bounds();
  report.area_mm2 = mesh.Area();
  report.volume_mm3 = mesh.Volume();
  CheckEncloses(report, name);
  report.findings.push_back("Lumen of " + Number(report.volume_mm3) + " mm^3, " +
                            Number(report.width_mm[0]) + " to " + Number(report.width_mm[2]) +
                            " mm wide (median " + Number(report.width_mm[1]) + " mm).");
  return surface;
}

}  // namespace torquer::vessel
