#include "host/simulator/vessel/lumen_union.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "host/simulator/vessel/face_sample.h"
#include "host/simulator/vessel/mesh_repair.h"
#include "host/simulator/vessel/surface_split.h"
#include "host/simulator/vessel/triangle_bvh.h"
#include "host/support/error.h"

namespace torquer::vessel {

using Eigen::Vector3d;
using repair::Number;
using repair::Place;

namespace {

// Largest share of a surface that may be wrong: numerical noise, and nicks in a wall.
constexpr double kNegligibleShare = 0.01;
// Largest share of a surface that may enclose a volume inside out: folds of a rough wall.
constexpr double kMostInverted = 0.05;
// Largest fraction of sheets in a surface; with more, the rest would not be a vessel.
constexpr double kMostOfNothing = 0.3;
// Share of the diagonal: surfaces within this distance lie on one another.
constexpr double kContactPerDiagonal = 1e-7;
// Share of the diagonal by which parts move if the union fails, up to kAttempts times as far.
constexpr double kMovePerDiagonal = 5e-6;
constexpr int kAttempts = 3;
// Share of a surface that counts as rounding.
constexpr double kNoShare = 1e-9;
// Fraction below which no message follows, because its rounded percentage would be 0.
constexpr double kLeastSaid = 1e-6;
// A region is a sheet if its winding numbers deviate on average more than this from integers.
constexpr double kSheet = 0.25;
constexpr size_t kSheetSamples = 64;
// Distance from an opening's cap, in its radii, at which a point lies clearly beside it.
constexpr double kBesideCap = 0.05;
// Largest number of face pairs that the report counts.
constexpr size_t kMostCounted = 1'000'000;
// With more faces in the lid of a surface, dipoles are quicker than crossings.
constexpr size_t kMostInLid = 100;
constexpr TriangleBvh::Signs kNoSigns = TriangleBvh::Signs::kNone;

// A step from the middle of a face to its outer side, much shorter than the face.
Vector3d StepOut(const TriangleMesh& mesh, size_t face) {
  const Vector3d twice = mesh.DoubleArea(face);
  const double area = twice.norm();
  return 1e-4 * std::sqrt(area) * twice / area;
}

// Faces joined over edges of two faces, sorted by decreasing area for sampling.
struct SurfaceRegion {
  std::vector<int32_t> faces;
  double area = 0;
  bool is_bounded = false;   // has an unbalanced edge
  std::vector<int32_t> rim;  // faces at open edges or edges of several faces
};

// True if a face is too narrow for its middle to distinguish its sides.
bool IsNarrow(const TriangleMesh& mesh, size_t face) {
  constexpr double kNarrow = 1e-3;
  double longest = 0;
  for (int c = 0; c < 3; ++c) {
    longest = std::max(longest, (mesh.Corner(face, (c + 1) % 3) - mesh.Corner(face, c)).norm());
  }
  return mesh.DoubleArea(face).norm() < kNarrow * longest * longest;
}

double AreaOf(const TriangleMesh& mesh, size_t face) { return mesh.DoubleArea(face).norm() / 2; }

std::vector<SurfaceRegion> RegionsOf(const TriangleMesh& mesh) {
  int count = 0;
  const std::vector<int> part = repair::Parts(mesh, &count);
  std::vector<SurfaceRegion> regions(static_cast<size_t>(count));
  for (size_t i = 0; i < part.size(); ++i) {
    regions[part[i]].faces.push_back(static_cast<int32_t>(i));
    regions[part[i]].area += AreaOf(mesh, i);
  }
  for (const int32_t face : repair::FacesAtUnbalancedEdges(mesh)) {
    regions[part[face]].is_bounded = true;
  }
  std::vector<char> meets_others(mesh.vertices_mm.size(), 0);
  const repair::EdgeFaults edges = repair::FindEdgeFaults(mesh);
  for (const auto* list : {&edges.open, &edges.several}) {
    for (const auto& [from, to] : *list) meets_others[from] = meets_others[to] = 1;
  }
  for (size_t i = 0; i < part.size(); ++i) {
    const auto& corners = mesh.triangles[i];
    if (!IsNarrow(mesh, i) && std::any_of(corners.begin(), corners.end(),
                                          [&](int32_t v) { return meets_others[v] != 0; })) {
      regions[part[i]].rim.push_back(static_cast<int32_t>(i));
    }
  }
  for (SurfaceRegion& region : regions) {
    std::stable_sort(region.faces.begin(), region.faces.end(),
                     [&](int32_t a, int32_t b) { return AreaOf(mesh, a) > AreaOf(mesh, b); });
  }
  return regions;
}

// Mean distance of the winding numbers beside a region from integers. It is 1/2 for a sheet, which
// encloses no volume, and near 0 for a wall.
double SheetScore(const TriangleBvh& surface, const TriangleMesh& mesh,
                  const SurfaceRegion& region) {
  double sum = 0, weight = 0;
  for (const auto& [face, area] : SampleFaces(mesh, region.faces, kSheetSamples)) {
    if (area == 0) continue;
    const double outer = surface.WindingNumber(mesh.Centroid(face) + StepOut(mesh, face));
    sum += area * std::abs(outer - std::round(outer));
    weight += area;
  }
  return weight > 0 ? sum / weight : 0;
}

TriangleMesh Part(const TriangleMesh& mesh, const std::vector<char>& keep, bool kept) {
  TriangleMesh part;
  part.vertices_mm = mesh.vertices_mm;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    if ((keep[i] != 0) == kept) part.triangles.push_back(mesh.triangles[i]);
  }
  repair::DropUnusedVertices(part);
  return part;
}

// Removes sheets, the clearest first, until every edge balances or no sheet is left. Returns their
// number.
size_t DropSheets(TriangleMesh& mesh, const std::string& name, TriangleMesh& left_out) {
  constexpr int kRounds = 20;
  constexpr double kAsClear = 0.8;
  size_t dropped = 0;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<SurfaceRegion> regions = RegionsOf(mesh);
    std::erase_if(regions, [](const SurfaceRegion& region) { return !region.is_bounded; });
    if (regions.empty()) break;
    const TriangleBvh surface(mesh, kNoSigns);
    std::vector<double> scores;
    for (const SurfaceRegion& region : regions) scores.push_back(SheetScore(surface, mesh, region));
    const double worst = *std::max_element(scores.begin(), scores.end());
    if (worst <= kSheet) break;
    std::vector<char> keep(mesh.triangles.size(), 1);
    size_t now = 0, faces = 0;
    for (size_t r = 0; r < regions.size(); ++r) {
      if (scores[r] < kAsClear * worst) continue;
      for (const int32_t face : regions[r].faces) keep[face] = 0;
      faces += regions[r].faces.size();
      ++now;
    }
    if (faces == mesh.triangles.size()) break;
    Append(left_out, Part(mesh, keep, false));
    mesh = Part(mesh, keep, true);
    dropped += now;
    // Parts that a sheet separated are now one part.
    MeshReport again;
    repair::Orient(mesh, name, again);
    repair::PointOutward(mesh, again);
  }
  return dropped;
}

// Verdict on the faces of a surface.
struct Verdict {
  std::vector<char> keep;
  // Areas: sheets, walls within the lumen, walls inside out, all walls.
  double nothing = 0, within = 0, inverted = 0, total = 0;
  size_t where_within = 0, where_inverted = 0;
};

// Winding numbers on both sides of the faces, found when they are wanted.
class FaceSides {
 public:
  explicit FaceSides(const TriangleBvh& surface)
      : surface_(surface), known_(surface.mesh().triangles.size()) {
    TriangleMesh lid = repair::ConeOverBorder(surface.mesh());
    may_count_ = lid.triangles.size() <= kMostInLid;
    if (may_count_ && !lid.triangles.empty()) {
      lid_ = std::make_unique<TriangleBvh>(std::move(lid), kNoSigns);
    }
  }

  TriangleBvh::WholeSides Of(int32_t face) {
    std::optional<TriangleBvh::WholeSides>& sides = known_[face];
    if (sides) return *sides;
    const Vector3d at = surface_.mesh().Centroid(face), step = StepOut(surface_.mesh(), face);
    if (may_count_) sides = surface_.CountCrossings(at, step, lid_.get());
    if (!sides) sides = surface_.WholeWindingNumbers(at, step);
    return *sides;
  }

 private:
  const TriangleBvh& surface_;
  std::vector<std::optional<TriangleBvh::WholeSides>> known_;
  std::unique_ptr<TriangleBvh> lid_;  // null for a closed surface
  bool may_count_ = false;
};

Verdict Judge(const TriangleBvh& surface) {
  const TriangleMesh& mesh = surface.mesh();
  Verdict verdict;
  verdict.keep.assign(mesh.triangles.size(), 0);
  double largest_within = 0, largest_inverted = 0;
  using Sides = TriangleBvh::WholeSides;
  const auto settle = [&](int32_t face, Sides sides) {
    const double area = AreaOf(mesh, face);
    const auto [outer, inner] = sides;
    verdict.total += area;
    verdict.keep[face] = static_cast<char>(outer <= 0 && inner >= 1);
    if (outer == inner && outer <= 0) verdict.nothing += area;
    if (outer >= 1) {
      verdict.within += area;
      if (area > largest_within) verdict.where_within = face;
      largest_within = std::max(largest_within, area);
    } else if (outer < 0) {
      verdict.inverted += area;
      if (area > largest_inverted) verdict.where_inverted = face;
      largest_inverted = std::max(largest_inverted, area);
    }
  };
  FaceSides sides_of(surface);
  const auto whole = [&](int32_t face) {
    return AreaOf(mesh, face) == 0 ? Sides{0, 0} : sides_of.Of(face);
  };
  for (const SurfaceRegion& region : RegionsOf(mesh)) {
    // Winding numbers are constant over a region unless something passes through it without an edge
    // there.
    const size_t samples = std::min(region.faces.size(), kSheetSamples);
    const Sides first = whole(region.faces[0]);
    const auto is_first = [&](int32_t face) { return whole(face) == first; };
    const bool one =
        std::all_of(region.faces.begin(), region.faces.begin() + static_cast<ptrdiff_t>(samples),
                    is_first) &&
        std::all_of(region.rim.begin(), region.rim.end(), is_first);
    for (const int32_t face : region.faces) settle(face, one ? first : whole(face));
  }
  return verdict;
}

// Keeps only one of several faces that lie on one another.
void DropCopies(const TriangleMesh& mesh, std::vector<char>& keep) {
  std::set<std::array<int32_t, 3>> seen;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (!keep[i]) continue;
    std::array<int32_t, 3> sorted = mesh.triangles[i];
    std::sort(sorted.begin(), sorted.end());
    keep[i] = static_cast<char>(seen.insert(sorted).second);
  }
}

// Fault of a result that is not the wall of a lumen.
struct Fault {
  double share = 0;  // of its area
  Vector3d where_mm = Vector3d::Zero();
};

Fault FindFault(const TriangleBvh& surface) {
  constexpr size_t kMostFaces = 4000;
  const TriangleMesh& mesh = surface.mesh();
  Fault fault;
  double total = 0, largest = 0;
  for (const auto& [face, area] : SampleFaces(mesh, kMostFaces)) {
    if (area == 0) continue;
    total += area;
    const Vector3d at = mesh.Centroid(face), step = StepOut(mesh, face);
    const double outer = surface.WindingNumber(at + step);
    const double inner = surface.WindingNumber(at - step);
    if (std::abs(outer) < 0.25 && std::abs(inner - 1) < 0.25) continue;
    fault.share += area;
    if (area > largest) fault.where_mm = at;
    largest = std::max(largest, area);
  }
  fault.share /= total;
  return fault;
}

// Moves each part a little, in different directions. Parts that nearly lie on one another then
// clearly intersect or do not. A vertex of several parts moves with one of them.
TriangleMesh MovedApart(TriangleMesh mesh, double by_mm) {
  int count = 0;
  const std::vector<int> part = repair::Parts(mesh, &count);
  std::vector<int> of_vertex(mesh.vertices_mm.size(), 0);
  for (size_t i = 0; i < part.size(); ++i) {
    for (const int32_t vertex : mesh.triangles[i]) of_vertex[vertex] = part[i];
  }
  for (size_t i = 0; i < of_vertex.size(); ++i) {
    const double turn = 2.4 * of_vertex[i], rise = std::cos(1.7 * of_vertex[i] + 1);
    const double wide = std::sqrt(1 - rise * rise);
    mesh.vertices_mm[i] += by_mm * Vector3d(wide * std::cos(turn), wide * std::sin(turn), rise);
  }
  return mesh;
}

// Result of a union: the wall of the lumen, and the parts left out.
struct United {
  std::unique_ptr<TriangleBvh> walls;  // everything but sheets, divided at intersections
  TriangleMesh wall, inner, sheets;
  size_t sheet_count = 0;
  Verdict verdict;
  Fault fault;
  bool nothing_goes = false;
};

// Throws UserError if the surface has no usable lumen.
United UniteOnce(const TriangleBvh& before, const std::string& name) {
  United united;
  std::optional<TriangleMesh> split =
      SplitAtIntersections(before, kContactPerDiagonal * before.mesh().Bounds().diagonal().norm());
  if (!split) {
    throw UserError(name +
                    ": the surface's faces intersect one another nearly everywhere, so it bounds "
                    "no lumen; export it again");
  }
  united.sheet_count = DropSheets(*split, name, united.sheets);
  united.walls = std::make_unique<TriangleBvh>(std::move(*split), kNoSigns);
  const TriangleMesh& mesh = united.walls->mesh();
  Verdict& verdict = united.verdict;
  verdict = Judge(*united.walls);
  if (verdict.inverted > kMostInverted * verdict.total) {
    throw UserError(name + ": " + Number(100 * verdict.inverted / verdict.total) +
                    " % of the surface is inside out, for instance at " +
                    Place(mesh.Centroid(verdict.where_inverted)) +
                    " (the surface intersects itself there, so the lumen is ambiguous); repair the "
                    "surface there");
  }
  DropCopies(mesh, verdict.keep);
  const double sheets_mm2 = united.sheets.Area();
  const double nothing = (sheets_mm2 + verdict.nothing) / (sheets_mm2 + verdict.total);
  if (nothing > kMostOfNothing) {
    throw UserError(name + ": " + Number(100 * nothing) +
                    " % of the surface encloses nothing (sheets without a second side, or faces "
                    "that do not share their vertices); export the lumen's closed surface");
  }
  united.inner = Part(mesh, verdict.keep, false);
  // Parts that only touch leave at most faces without area.
  united.nothing_goes = united.sheet_count == 0 && united.inner.Area() <= kNoShare * verdict.total;
  if (united.nothing_goes) return united;
  united.wall = Part(mesh, verdict.keep, true);
  if (united.wall.triangles.empty()) {
    throw UserError(name + ": the surface encloses no lumen; export it again");
  }
  united.fault = FindFault(TriangleBvh(united.wall, kNoSigns));
  return united;
}

void Report(const United& united, const TriangleMesh& before,
            const std::vector<std::pair<int32_t, int32_t>>& cuts, MeshReport& report) {
  const Verdict& verdict = united.verdict;
  const TriangleMesh& mesh = united.walls->mesh();
  if (united.sheet_count > 0) {
    report.findings.push_back(
        repair::Count(united.sheet_count, "sheet that encloses", "sheets that enclose") +
        " nothing (the first at " + Place(united.sheets.Centroid(0)) + "), left out.");
  }
  if (!cuts.empty()) {
    report.findings.push_back(
        repair::Count(cuts.size(), "pair", "pairs") + " of faces intersect, the first at " +
        Place(before.Centroid(cuts.front().first)) + ": divided where they meet.");
  }
  if (verdict.within > kLeastSaid * verdict.total) {
    report.findings.push_back(
        Number(100 * verdict.within / verdict.total) +
        " % of the surface lay within the lumen of another part of it, for instance at " +
        Place(mesh.Centroid(verdict.where_within)) +
        ": left out; the lumen is the union of the enclosed volumes.");
  }
  if (verdict.inverted > kLeastSaid * verdict.total) {
    report.findings.push_back(Number(100 * verdict.inverted / verdict.total) +
                              " % of the surface is folded over and inside out, for instance at " +
                              Place(mesh.Centroid(verdict.where_inverted)) + ": left out.");
  }
}

// Turns openings whose caps faced into the lumen before their part was turned inside out.
void FaceOutward(std::vector<Opening>& openings, const TriangleBvh& surface) {
  for (Opening& opening : openings) {
    const Vector3d step = kBesideCap * opening.radius_mm * opening.outward;
    if (surface.WindingNumber(opening.center_mm + step) <=
        surface.WindingNumber(opening.center_mm - step)) {
      continue;
    }
    opening.outward = -opening.outward;
    opening.inward = -opening.inward;
  }
}

}  // namespace

void Unite(SurfaceMesh& surface, const std::string& name) {
  MeshReport& report = surface.report;
  const TriangleBvh before(surface.mesh, kNoSigns);
  FaceOutward(report.openings, before);
  const auto cuts = before.FindIntersections(kMostCounted);
  int parts = 0;
  repair::Parts(before.mesh(), &parts);
  if (cuts.empty() && parts == 1 && repair::FacesAtUnbalancedEdges(before.mesh()).empty()) return;
  report.intersections += cuts.size();

  United united = UniteOnce(before, name);
  for (int attempt = 1; attempt <= kAttempts && united.fault.share > kNegligibleShare; ++attempt) {
    const double by_mm = attempt * kMovePerDiagonal * before.mesh().Bounds().diagonal().norm();
    united = UniteOnce(TriangleBvh(MovedApart(before.mesh(), by_mm), kNoSigns), name);
  }
  if (united.nothing_goes) return;
  if (united.fault.share > kNegligibleShare) {
    throw UserError(name + ": " + Number(100 * united.fault.share) +
                    " % of the surface does not separate inside from outside, for instance at " +
                    Place(united.fault.where_mm) +
                    " (missing or extra faces); repair the surface there");
  }
  Report(united, before.mesh(), cuts, report);
  surface.mesh = std::move(united.wall);
  report.left_out_mm2 += united.sheets.Area() + united.inner.Area();
  Append(surface.left_out, united.sheets);
  Append(surface.left_out, united.inner);
  FaceOutward(report.openings, *united.walls);
  std::erase_if(report.openings, [&](const Opening& opening) {
    const Vector3d step = kBesideCap * opening.radius_mm * opening.outward;
    return united.walls->WindingNumber(opening.center_mm + step) > 0.5 ||
           united.walls->WindingNumber(opening.center_mm - step) < 0.5;
  });
}

}  // namespace torquer::vessel
