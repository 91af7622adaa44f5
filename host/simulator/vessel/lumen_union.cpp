#include "host/simulator/vessel/lumen_union.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "host/simulator/vessel/face_sample.h"
#include "host/simulator/vessel/lumen_sheets.h"
#include "host/simulator/vessel/mesh_repair.h"
#include "host/simulator/vessel/surface_regions.h"
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
// Distance from an opening's cap, in its radii, at which a point lies clearly beside it.
constexpr double kBesideCap = 0.05;
// Pairs of intersecting faces per face, above which a union takes so long that a sample pays.
constexpr double kManyCuts = 0.1;
// Largest number of face pairs that the report counts.
constexpr size_t kMostCounted = 1'000'000;
// With more faces in the lid of a surface, dipoles are quicker than crossings.
constexpr size_t kMostInLid = 100;
constexpr TriangleBvh::Signs kNoSigns = TriangleBvh::Signs::kNone;

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
    TriangleMesh lid = repair::ConesOverBorder(surface.mesh());
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

Verdict Judge(const TriangleBvh& surface, const std::vector<SurfaceRegion>& regions) {
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
  for (const SurfaceRegion& region : regions) {
    // Winding numbers are constant over a region unless something passes through it without an edge
    // there.
    const size_t samples = std::min(region.faces.size(), kRegionSamples);
    const Sides first = whole(region.faces[0]);
    const auto is_first = [&](int32_t face) { return whole(face) == first; };
    const bool one =
        std::all_of(region.faces.begin(), region.faces.begin() + static_cast<ptrdiff_t>(samples),
                    is_first) &&
        std::all_of(region.rim.begin(), region.rim.end(), is_first);
    if (!one) {
      // In the order of the file, where the next face is near: its ray meets the same memory.
      std::vector<int32_t> in_file = region.faces;
      std::sort(in_file.begin(), in_file.end());
      for (const int32_t face : in_file) whole(face);
    }
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

[[noreturn]] void RefuseInverted(const std::string& name, double share, const Vector3d& where_mm) {
  throw UserError(name + ": " + Number(100 * share) +
                  " % of the surface is inside out, for instance at " + Place(where_mm) +
                  " (the surface intersects itself there, so the lumen is ambiguous); repair the "
                  "surface there");
}

// Throws if a sample of a closed surface shows that too much of it is inside out. Its union would
// be refused too, but after a long time.
void RefuseIfInverted(const TriangleBvh& surface, const std::string& name) {
  constexpr size_t kMostFaces = 100'000;
  constexpr double kStandardErrors = 4;
  const TriangleMesh& mesh = surface.mesh();
  std::mt19937 random(20261);
  const auto share = [&random] { return random() / (random.max() + 1.0); };
  double total = 0, squares = 0, largest = 0;
  Fault inverted;
  for (const auto& [face, area] : SampleFaces(mesh, kMostFaces)) {
    if (area == 0) continue;
    // A random point of the face (Osada et al. 2002, eq. 1).
    const double a = std::sqrt(share()), b = share();
    const Vector3d at = (1 - a) * mesh.Corner(face, 0) + a * (1 - b) * mesh.Corner(face, 1) +
                        a * b * mesh.Corner(face, 2);
    const Vector3d step = StepOut(mesh, face);
    const auto sides = surface.CountCrossings(at, step, nullptr);
    total += area;
    squares += area * area;
    if ((sides ? *sides : surface.WholeWindingNumbers(at, step)).outer >= 0) continue;
    inverted.share += area;
    if (area > largest) inverted.where_mm = at;
    largest = std::max(largest, area);
  }
  inverted.share /= total;
  const double standard_error = std::sqrt(inverted.share * (1 - inverted.share) * squares) / total;
  if (inverted.share - kStandardErrors * standard_error > kMostInverted) {
    RefuseInverted(name, inverted.share, inverted.where_mm);
  }
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
  WithoutSheets rest = DropSheets(std::move(*split), name);
  united.walls = std::move(rest.walls);
  united.sheets = std::move(rest.sheets);
  united.sheet_count = rest.sheet_count;
  const TriangleMesh& mesh = united.walls->mesh();
  Verdict& verdict = united.verdict;
  verdict = Judge(*united.walls, rest.regions);
  if (verdict.inverted > kMostInverted * verdict.total) {
    RefuseInverted(name, verdict.inverted / verdict.total, mesh.Centroid(verdict.where_inverted));
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
  const bool is_closed = repair::FacesAtUnbalancedEdges(before.mesh()).empty();
  if (cuts.empty() && parts == 1 && is_closed) return;
  report.intersections += cuts.size();
  if (is_closed && cuts.size() > kManyCuts * before.mesh().triangles.size()) {
    RefuseIfInverted(before, name);
  }

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
