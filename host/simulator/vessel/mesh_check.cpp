#include "host/simulator/vessel/mesh_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "host/simulator/vessel/face_sample.h"
#include "host/simulator/vessel/flat_ends.h"
#include "host/simulator/vessel/mesh_import.h"
#include "host/simulator/vessel/triangle_bvh.h"
#include "host/support/error.h"
#include "host/support/key_table.h"
#include "host/support/printable_text.h"

namespace torquer::vessel {

using Eigen::Vector3d;

namespace {

constexpr double kLeastRoomMm = 0.3;
// No vessel is cut at more places. A coarser surface has as many faces that look like ends.
constexpr size_t kMostFlatEnds = 24;

// Rounds to the digits that a scene will have.
Vector3d Rounded(const Vector3d& v, double per_unit) {
  return (v * per_unit).array().round().matrix() / per_unit;
}

// Place with the most room within one diameter behind an open end.
EntryProposal BehindOpening(const TriangleBvh& surface, const Opening& opening) {
  constexpr int kSteps = 40;
  EntryProposal best;
  best.direction = Rounded(opening.inward, 1000);
  for (int step = 1; step <= kSteps; ++step) {
    const double way_mm = 2 * opening.radius_mm * step / kSteps;
    const Vector3d at = Rounded(opening.center_mm + way_mm * opening.inward, 10);
    const double room_mm = surface.Distance(at);
    if (room_mm <= best.room_mm) continue;
    best.point_mm = at;
    best.room_mm = room_mm;
  }
  return best;
}

// Entry for a surface without open ends: middle of the widest place, along the longest free way.
EntryProposal WidestPlace(const TriangleBvh& surface) {
  constexpr size_t kFaces = 500;
  constexpr int kDirections = 200;
  const TriangleMesh& mesh = surface.mesh();
  EntryProposal best;
  for (const SampledFace& sample : SampleFaces(mesh, kFaces)) {
    const Vector3d middle = mesh.Centroid(sample.face);
    const Vector3d inward = -mesh.DoubleArea(sample.face).normalized();
    const double width_mm = surface.CastRay(middle, inward, 1e-6);
    if (!std::isfinite(width_mm)) continue;
    const Vector3d at = Rounded(middle + width_mm / 2 * inward, 10);
    const double room_mm = surface.Distance(at);
    if (room_mm <= best.room_mm) continue;
    best.point_mm = at;
    best.room_mm = room_mm;
  }
  if (best.room_mm <= 0) return best;
  double longest_mm = 0;
  const double golden = M_PI * (3 - std::sqrt(5.0));
  for (int k = 0; k < kDirections; ++k) {
    const double z = 1 - 2 * (k + 0.5) / kDirections, wide = std::sqrt(1 - z * z);
    const Vector3d direction(wide * std::cos(golden * k), wide * std::sin(golden * k), z);
    const double way_mm = surface.CastRay(best.point_mm, direction, 1e-6);
    if (!std::isfinite(way_mm) || way_mm <= longest_mm) continue;
    longest_mm = way_mm;
    best.direction = Rounded(direction, 1000);
  }
  return best;
}

void ProposeEntries(const SurfaceMesh& surface, MeshCheck& check) {
  const TriangleBvh bvh(surface.mesh);
  std::vector<EntryProposal>& entries = check.entries;
  const auto add_behind = [&](const std::vector<Opening>& ends, const char* place) {
    for (const Opening& end : ends) {
      entries.push_back(BehindOpening(bvh, end));
      entries.back().place = place;
    }
  };
  add_behind(surface.report.openings, "behind an open end");
  if (entries.empty()) {
    const std::vector<Opening> ends = FindFlatEnds(surface.mesh);
    if (ends.size() <= kMostFlatEnds) {
      add_behind(ends, "behind a flat end");
    } else {
      check.doubtful_ends = ends.size();
    }
  }
  if (entries.empty()) entries.push_back(WidestPlace(bvh));
  std::erase_if(entries, [](const EntryProposal& entry) { return entry.room_mm < kLeastRoomMm; });
}

std::string Text(const Vector3d& v, int digits) {
  return fmt::format("{:.{}f} x {:.{}f} x {:.{}f}", v.x(), digits, v.y(), digits, v.z(), digits);
}

// Coarsest of the usual cell widths that fits eight times across all but the narrowest places.
double ProposeVoxel(const MeshReport& report) {
  for (const double voxel_mm : {1.0, 0.5, 0.25}) {
    if (8 * voxel_mm <= report.width_mm[0]) return voxel_mm;
  }
  return 0.1;
}

}  // namespace

MeshCheck CheckMesh(const std::string& contents, const std::string& path) {
  MeshCheck check;
  check.path = path;
  try {
    check.raw = ImportMesh(contents, path, 1);
    check.triangles_read = check.raw.triangles.size();
    check.size = check.raw.Bounds().sizes();
    check.unit = GuessUnit(check.raw);
    const MeshUnit unit = check.unit.value_or(MeshUnit::kMillimeter);
    for (Vector3d& vertex : check.raw.vertices_mm) vertex *= UnitOf(unit).mm;
    CheckSize(check.raw, path, unit);
    TriangleMesh file = check.raw;
    MeshReport welding;
    repair::Weld(check.raw, WeldToleranceMm(check.raw), welding);
    repair::DropUseless(check.raw, welding);
    check.vertices_welded = welding.vertices_welded;
    check.edges = repair::FindEdgeFaults(check.raw);
    repair::Parts(check.raw, &check.components);
    check.surface = RepairSurface(std::move(file), path, unit);
    ProposeEntries(*check.surface, check);
  } catch (const UserError& error) {
    check.refusal = error.what();
  }
  return check;
}

std::string DescribeCheck(const MeshCheck& check) {
  std::string out = Printable(check.path, 4096) + "\n";
  const auto line = [&out](const std::string& name, const std::string& text) {
    out += fmt::format("  {:14}{}\n", name.empty() ? name : name + ":", text);
  };
  if (check.triangles_read > 0) {
    line("triangles",
         fmt::format("{}, with {} vertices after {} coincident ones were merged",
                     check.triangles_read, check.raw.vertices_mm.size(), check.vertices_welded));
    const Vector3d& size = check.size;
    std::string unit =
        fmt::format("{:.4g} x {:.4g} x {:.4g}, which is not the size of a vessel in any unit",
                    size.x(), size.y(), size.z());
    if (check.unit) {
      unit = fmt::format("{:.4g} x {:.4g} x {:.4g}, interpreted as {}; the vessel measures {} mm",
                         size.x(), size.y(), size.z(), UnitOf(*check.unit).name,
                         Text(check.raw.Bounds().sizes(), 1));
    }
    line("size", unit);
  }
  if (check.components > 0) {
    line("components", std::to_string(check.components));
    line("open edges", std::to_string(check.edges.open.size()));
    line("shared edges",
         fmt::format("{} with more than two triangles", check.edges.several.size()));
    line("orientation", fmt::format("{} edges between triangles of opposite orientation",
                                    check.edges.disagreeing));
  }
  if (check.surface) {
    const MeshReport& report = check.surface->report;
    line("inside", report.was_shell    ? "the lumen within a wall with thickness"
                   : report.was_inward ? "a lumen whose normals pointed inward"
                                       : "a lumen whose normals point outward");
    for (std::size_t i = 1; i < report.findings.size(); ++i) {
      line(i == 1 ? "findings" : "", report.findings[i]);
    }
    if (check.doubtful_ends > 0) {
      line("flat ends", fmt::format("{} faces look like ends, more than a vessel has; so the entry "
                                    "is the widest place",
                                    check.doubtful_ends));
    }
    line("loads", "yes");
  } else {
    line("loads", "no: " + check.refusal);
  }
  return out;
}

std::string ProposeScene(const MeshCheck& check) {
  if (!check.surface) return "";
  std::string out = fmt::format(
      "[vessel]\nkind = \"surface\"\nfile = {}\nmesh_unit = \"{}\"\nvoxel_mm = {:g}\n"
      "wall_stiffness_N_mm2 = 10\n",
      key_values::Write(Key{}, std::filesystem::path(check.path).filename().string()),
      UnitOf(*check.unit).name, ProposeVoxel(check.surface->report));
  for (std::size_t i = 0; i < check.entries.size(); ++i) {
    const auto& [point_mm, direction, room_mm, place] = check.entries[i];
    const char* const comment = i == 0 ? "" : "# ";
    out += fmt::format("\n{}[entry]  # {} in the picture: {}, {:.2f} mm from the wall\n", comment,
                       i + 1, place, room_mm);
    out += fmt::format("{}point_mm = [{:.1f}, {:.1f}, {:.1f}]\n", comment, point_mm.x(),
                       point_mm.y(), point_mm.z());
    out += fmt::format("{}direction = [{:.3f}, {:.3f}, {:.3f}]\n", comment, direction.x(),
                       direction.y(), direction.z());
  }
  return out;
}

}  // namespace torquer::vessel
