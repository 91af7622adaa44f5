#include "host/simulator/vessel/kinds/surface.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Core>
#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/vessel/length_unit.h"
#include "host/simulator/vessel/lumen_check.h"
#include "host/simulator/vessel/mesh_import.h"
#include "host/simulator/vessel/patient_space.h"
#include "host/support/error.h"

namespace torquer::vessel {

namespace {

struct SurfaceSpec : TableSpec {
  std::string file;
  MeshUnit unit = MeshUnit::kMillimeter;
  double voxel_mm = BrickFieldOptions().voxel_mm;
  std::optional<std::string> centerlines;
};

std::vector<std::string> UnitNames() {
  std::vector<std::string> names;
  for (const LengthUnit& unit : kLengthUnits) names.emplace_back(unit.name);
  return names;
}

const Keys<SurfaceSpec>& SurfaceKeys() {
  static const Keys<SurfaceSpec> keys =
      Keys<SurfaceSpec>()
          .Required()
          .Text("file", &SurfaceSpec::file,
                "surface file (STL, OBJ or PLY); its path is relative to the scene file")
          .Required()
          .Choice("mesh_unit", &SurfaceSpec::unit, UnitNames(), "unit of the file's coordinates")
          .Number("voxel_mm", &SurfaceSpec::voxel_mm, 0.02, 4, "mm",
                  "finest cell of the distance field; at most half the thickness of the thinnest "
                  "wall between two lumens")
          .Otherwise("none")
          .Text("centerlines", &SurfaceSpec::centerlines,
                "folder with centerlines from 3D Slicer (.mrk.json), in the frame of the surface "
                "file; their unit is the one that they name, otherwise mm")
          .Example(
              "kind = \"surface\"\n"
              "file = \"meshes/neuro_arch/surface.obj\"\n"
              "mesh_unit = \"mm\"\n"
              "voxel_mm = 0.5\n"
              "centerlines = \"meshes/neuro_arch/centerlines\"\n"
              "wall_stiffness_N_mm2 = 10\n");
  return keys;
}

void RefuseWrongRadii(const Vessel& vessel, const std::string& folder) {
  const auto found = FindWrongRadius(vessel.centerlines, vessel.surface->surface());
  if (!found) return;
  const Eigen::Vector3d& at = found->position_mm;
  const std::string misfit =
      found->is_too_large
          ? fmt::format("but the wall is nowhere more than {:.4g} mm from a centerline",
                        found->room_mm)
          : fmt::format(
                "the largest of all, but the wall is up to {:.4g} mm from a centerline, "
                "and mostly more than five radii",
                found->room_mm);
  throw UserError(fmt::format(
      "{}/{}.mrk.json: the Radius {:.1f} mm along the curve, at ({:.1f}, {:.1f}, {:.1f}) mm, is "
      "{:.4g} mm, {}; name the unit of the radii in \"units\" of the measurement, or compute them "
      "again",
      folder, found->curve, found->at_mm, at.x(), at.y(), at.z(), found->radius_mm, misfit));
}

void RefuseOtherSpace(const Vessel& vessel, const std::string& folder) {
  const SharesInside inside = FindSharesInside(vessel.centerlines, vessel.surface->surface());
  if (!inside.IsInOtherSpace()) return;
  throw UserError(fmt::format(
      "{}: {:.0f} % of the centerlines' length lies in the lumen, but {:.0f} % with the other "
      "signs of x and y; so one is in LPS and the other in RAS. Name the space of each: SPACE=LPS "
      "or SPACE=RAS in a comment at the beginning of the surface file, and \"coordinateSystem\" in "
      "the curves",
      folder, 100 * inside.as_given, 100 * inside.turned));
}

// One finding for all curves.
void ReportStretchesOutside(Vessel& vessel) {
  std::vector<std::pair<std::string, std::string>> curves;  // name, stretches
  double farthest_mm = 0;
  for (const OutsideStretch& stretch :
       FindStretchesOutside(vessel.centerlines, vessel.surface->surface())) {
    const std::string from = fmt::format("{:.1f}", stretch.from_mm);
    const std::string to = fmt::format("{:.1f}", stretch.to_mm);
    if (from == to) continue;
    if (curves.empty() || curves.back().first != stretch.curve)
      curves.emplace_back(stretch.curve, "");
    farthest_mm = std::max(farthest_mm, -stretch.worst_clearance_mm);
    std::string& stretches = curves.back().second;
    stretches += (stretches.empty() ? "" : ", ") + from + " to " + to;
  }
  if (curves.empty()) return;
  std::vector<std::string> all;
  for (const auto& [curve, stretches] : curves) all.push_back(curve + " (" + stretches + ")");
  vessel.findings.push_back(fmt::format(
      "{} of {} centerlines run outside the lumen in places, by up to {:.2g} mm. Places in mm of "
      "their length: {}",
      curves.size(), vessel.centerlines.curves().size(), farthest_mm, fmt::join(all, ", ")));
}

// vessel.contents holds the surface alone.
void ReadCenterlines(const SurfaceSpec& spec, const std::filesystem::path& folder, Vessel& vessel) {
  try {
    std::vector<CurveFile> files = ReadCurveFiles((folder / *spec.centerlines).string());
    vessel.centerlines =
        ParseSlicerCurves(files, SpaceOfSurface(vessel.contents.front()), &vessel.findings);
    for (CurveFile& file : files) vessel.contents.push_back(std::move(file.contents));
    RefuseOtherSpace(vessel, (folder / *spec.centerlines).string());
    RefuseWrongRadii(vessel, (folder / *spec.centerlines).string());
  } catch (const UserError& error) {
    spec.origin.Refuse("centerlines", error.what());
  }
  ReportStretchesOutside(vessel);
}

Vessel Build(const SurfaceSpec& spec, const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / spec.file;
  MeshVesselOptions options;
  options.unit = spec.unit;
  options.field.voxel_mm = spec.voxel_mm;
  Vessel vessel;
  try {
    std::string contents = ReadMeshContents(path.string());
    vessel.surface = MeshVessel::Make(contents, path.string(), options);
    vessel.contents.push_back(std::move(contents));
  } catch (const UserError& error) {
    spec.origin.Refuse("file", error.what());
  }
  vessel.bricks = std::shared_ptr<const BrickField>(vessel.surface, &vessel.surface->field());
  vessel.field = vessel.bricks;
  const MeshReport& report = vessel.surface->report();
  vessel.bounds_mm = report.bounds_mm;
  vessel.findings = report.findings;
  vessel.description =
      fmt::format("surface {}, {} triangles, voxel {:g} mm", path.filename().string(),
                  vessel.surface->mesh().triangles.size(), spec.voxel_mm);
  if (spec.centerlines) ReadCenterlines(spec, folder, vessel);
  return vessel;
}

}  // namespace

VesselKind SurfaceKind() {
  return MakeVesselKind("surface", "surface from a file, such as a segmented scan", SurfaceKeys(),
                        Build);
}

}  // namespace torquer::vessel
