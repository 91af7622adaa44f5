#include "host/simulator/scene/vessel_reader.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>
#include <utility>

#include "host/simulator/vessel/phantoms.h"
#include "host/simulator/vessel/tube_field.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"

namespace torquer::scene {

namespace {

Vessel FromTubes(vessel::TubeVessel tubes, std::string description) {
  Vessel result;
  result.field = std::move(tubes.field);
  result.centerlines = std::move(tubes.centerlines);
  result.bounds_mm = tubes.bounds_mm;
  result.description = std::move(description);
  return result;
}

}  // namespace

Vessel VesselReader::Read() {
  switch (table_.Choice("kind", {"phantom", "tubes", "surface"})) {
    case 0:
      return ReadPhantom();
    case 1:
      return ReadTubes();
    default:
      return ReadSurface();
  }
}

Vessel VesselReader::ReadPhantom() {
  switch (table_.Choice("phantom", {"ty", "straight", "torus"})) {
    case 0:
      return FromTubes(vessel::MakeTyPhantom(), "T-Y phantom, radius 4 mm, main path 285 mm");
    case 1: {
      const double length = table_.Number("length_mm", 1, 5000);
      const double radius = table_.Number("radius_mm", 0.1, 50);
      std::ostringstream what;
      what << "straight tube, " << length << " mm, radius " << radius << " mm";
      return FromTubes(vessel::MakeStraightTube(length, radius), what.str());
    }
    default: {
      const double bend = table_.Number("bend_radius_mm", 1, 5000);
      const double radius = table_.Number("radius_mm", 0.1, 50);
      const double angle = table_.Number("angle_deg", 1, 360) * 3.14159265358979323846 / 180;
      std::ostringstream what;
      what << "torus arc, bend radius " << bend << " mm, radius " << radius << " mm";
      return FromTubes(vessel::MakeTorus(bend, radius, angle), what.str());
    }
  }
}

Vessel VesselReader::ReadTubes() {
  const double union_width_mm = table_.Number("union_width_mm", 0, 20, 2);
  const double join_mm = table_.Number("join_tolerance_mm", 0.01, 50, 1);
  std::vector<vessel::Tube> tubes;
  for (StrictTable* tube : table_.Tables("tube")) {
    const std::string name = tube->Text("name");
    const std::vector<Eigen::Vector3d> corners = tube->Points("points_mm", 2);
    const double bend = tube->Number("bend_radius_mm", 0.1, 1e6, 1e6);
    std::vector<double> radii = tube->Numbers("radii_mm", 0.1, 50);
    try {
      vessel::Tube made{name, vessel::ArcLinePath::FromCorners(corners, bend), radii, {}};
      made.radius_at_mm = made.axis.corner_arc_lengths_mm();
      if (radii.size() == 1) {
        made.radius_at_mm = {0};
      } else if (radii.size() != corners.size()) {
        tube->Refuse("radii_mm", "needs one radius, or one for each of points_mm");
      }
      tubes.push_back(std::move(made));
    } catch (const UserError& error) {
      throw UserError(tube->Where() + ": tube " + name + ": " + error.what());
    }
  }
  if (tubes.empty()) table_.Refuse("tube", "is missing; add a table [[vessel.tube]]");
  try {
    return FromTubes(vessel::MakeTubeVessel(tubes, union_width_mm, join_mm),
                     std::to_string(tubes.size()) + " tubes");
  } catch (const UserError& error) {
    throw UserError(table_.Where() + ": vessel: " + error.what());
  }
}

Vessel VesselReader::ReadSurface() {
  const std::string path = (folder_ / table_.Text("file")).string();
  vessel::MeshVesselOptions options;
  options.unit = table_.Choice("mesh_unit", {"mm", "m"}) == 0 ? vessel::MeshUnit::kMillimeter
                                                              : vessel::MeshUnit::kMeter;
  options.field.voxel_mm = table_.Number("voxel_mm", 0.02, 4, options.field.voxel_mm);
  files_.push_back(path);
  Vessel result;
  try {
    result.surface = vessel::MeshVessel::Open(path, options);
  } catch (const UserError& error) {
    throw UserError(table_.Where("file") + ": vessel.file: " + error.what());
  }
  // The coarse levels serve wherever the wire never goes; the fine bricks come as it comes.
  result.surface->field().Build(1, static_cast<int>(std::thread::hardware_concurrency()));
  result.field = std::shared_ptr<const ClearanceField>(result.surface, &result.surface->field());
  const vessel::MeshReport& report = result.surface->report();
  result.bounds_mm = report.bounds_mm;
  result.findings = report.findings;
  std::ostringstream what;
  what << "surface " << std::filesystem::path(path).filename().string() << ", "
       << result.surface->mesh().triangles.size() << " triangles, voxel " << options.field.voxel_mm
       << " mm";
  result.description = what.str();

  if (table_.Has("centerlines")) {
    const std::string folder = (folder_ / table_.Text("centerlines")).string();
    try {
      result.centerlines = vessel::ReadSlicerCurves(folder);
    } catch (const UserError& error) {
      throw UserError(table_.Where("centerlines") + ": vessel.centerlines: " + error.what());
    }
    std::vector<std::string> curves;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      if (entry.is_regular_file()) curves.push_back(entry.path().string());
    }
    std::sort(curves.begin(), curves.end());
    files_.insert(files_.end(), curves.begin(), curves.end());
    for (const vessel::OutsideStretch& stretch :
         vessel::FindStretchesOutside(result.centerlines, *result.field)) {
      std::ostringstream finding;
      finding << "centerline " << stretch.curve << " runs outside the lumen from "
              << stretch.from_mm << " to " << stretch.to_mm << " mm of its length";
      result.findings.push_back(finding.str());
    }
  }
  return result;
}

std::uint64_t HashFiles(const std::string& first, const std::vector<std::string>& others) {
  std::uint64_t hash = Fnv1a("");
  const auto add = [&hash](const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    std::ostringstream text;
    text << in.rdbuf();
    hash = Fnv1a(text.str(), hash);
  };
  add(first);
  for (const std::string& path : others) add(path);
  return hash;
}

}  // namespace torquer::scene
