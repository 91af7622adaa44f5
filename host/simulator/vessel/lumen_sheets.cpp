#include "host/simulator/vessel/lumen_sheets.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "host/simulator/vessel/face_sample.h"
#include "host/simulator/vessel/mesh_repair.h"

namespace torquer::vessel {

namespace {

// A region is a sheet if its winding numbers deviate on average more than this from integers.
constexpr double kSheet = 0.25;

// Mean distance of the winding numbers beside a region from integers. It is 1/2 for a sheet, which
// encloses no volume, and near 0 for a wall.
double SheetScore(const TriangleBvh& surface, const TriangleMesh& mesh,
                  const SurfaceRegion& region) {
  double sum = 0, weight = 0;
  for (const auto& [face, area] : SampleFaces(mesh, region.faces, kRegionSamples)) {
    if (area == 0) continue;
    const double outer = surface.WindingNumber(mesh.Centroid(face) + StepOut(mesh, face));
    sum += area * std::abs(outer - std::round(outer));
    weight += area;
  }
  return weight > 0 ? sum / weight : 0;
}

// Indices of the clearest sheets among regions; none if every edge balances or all are walls.
std::vector<size_t> FindSheets(const TriangleBvh& surface,
                               const std::vector<SurfaceRegion>& regions) {
  constexpr double kAsClear = 0.8;
  std::vector<double> scores(regions.size(), 0);
  double worst = kSheet;
  for (size_t r = 0; r < regions.size(); ++r) {
    if (!regions[r].is_bounded) continue;
    scores[r] = SheetScore(surface, surface.mesh(), regions[r]);
    worst = std::max(worst, scores[r]);
  }
  std::vector<size_t> sheets;
  if (worst <= kSheet) return sheets;
  for (size_t r = 0; r < regions.size(); ++r) {
    if (scores[r] >= kAsClear * worst) sheets.push_back(r);
  }
  return sheets;
}

// Gives one orientation, outward, to each part that consists of several earlier ones. The others
// keep theirs: a fold that is inside out must not become a part of the lumen.
//
// before: the earlier part of each face.
void OrientJoined(TriangleMesh& mesh, const std::vector<size_t>& before, const std::string& name) {
  int count = 0;
  const std::vector<int> part = repair::Parts(mesh, &count);
  std::vector<size_t> earlier(static_cast<size_t>(count));
  for (size_t i = 0; i < part.size(); ++i) earlier[part[i]] = before[i];
  std::vector<char> is_joined(static_cast<size_t>(count), 0);
  for (size_t i = 0; i < part.size(); ++i) {
    if (earlier[part[i]] != before[i]) is_joined[part[i]] = 1;
  }
  if (std::find(is_joined.begin(), is_joined.end(), 1) == is_joined.end()) return;
  TriangleMesh turned = mesh;
  MeshReport again;
  repair::Orient(turned, name, again);
  repair::PointOutward(turned, again);
  for (size_t i = 0; i < part.size(); ++i) {
    // PointOutward renumbers the vertices. A face that is turned has another second corner.
    if (!is_joined[part[i]] || turned.Corner(i, 1) == mesh.Corner(i, 1)) continue;
    std::swap(mesh.triangles[i][1], mesh.triangles[i][2]);
  }
}

}  // namespace

WithoutSheets DropSheets(TriangleMesh mesh, const std::string& name) {
  constexpr int kRounds = 20;
  WithoutSheets result;
  for (int round = 0;; ++round) {
    result.walls = std::make_unique<TriangleBvh>(std::move(mesh), TriangleBvh::Signs::kNone);
    const TriangleMesh& walls = result.walls->mesh();
    result.regions = RegionsOf(walls);
    if (round == kRounds) return result;
    const std::vector<size_t> sheets = FindSheets(*result.walls, result.regions);
    if (sheets.empty()) return result;
    std::vector<char> keep(walls.triangles.size(), 1);
    for (const size_t r : sheets) {
      for (const int32_t face : result.regions[r].faces) keep[face] = 0;
    }
    std::vector<size_t> region_of(keep.size());
    for (size_t r = 0; r < result.regions.size(); ++r) {
      for (const int32_t face : result.regions[r].faces) region_of[face] = r;
    }
    std::vector<size_t> before;  // region of each face that is kept
    for (size_t i = 0; i < keep.size(); ++i) {
      if (keep[i]) before.push_back(region_of[i]);
    }
    if (before.empty()) return result;
    Append(result.sheets, Part(walls, keep, false));
    result.sheet_count += sheets.size();
    mesh = Part(walls, keep, true);
    OrientJoined(mesh, before, name);
  }
}

}  // namespace torquer::vessel
