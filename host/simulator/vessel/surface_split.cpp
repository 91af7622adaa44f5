#include "host/simulator/vessel/surface_split.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "host/simulator/vessel/mesh_repair.h"
#include "host/simulator/vessel/vertex_welder.h"

namespace torquer::vessel {

using Eigen::Vector3d;

namespace {

using Polygon = std::vector<Vector3d>;  // convex, flat, counterclockwise about its face's normal

// Faces of a vessel pass through only a few others, at junctions of branches.
constexpr size_t kMostCuts = 1'000'000, kMostPieces = 5'000, kMostPiecesPerFace = 4;

struct Segment {
  Vector3d from, to;
  double Length() const { return (to - from).norm(); }
};

struct Plane {
  Vector3d normal;  // unit
  double offset_mm;
  double Height(const Vector3d& p) const { return normal.dot(p) - offset_mm; }
};

// Cutter of a face: a plane, limited to the segment that it shares with the face.
struct Cutter {
  Plane plane;
  Segment segment;
};

Plane PlaneThrough(const Vector3d& point, const Vector3d& normal) {
  const Vector3d unit = normal.normalized();
  return {unit, unit.dot(point)};
}

// Part of a segment within a polygon or at most slack_mm outside of it.
std::optional<Segment> Clip(const Segment& segment, const Polygon& polygon, const Vector3d& normal,
                            double slack_mm) {
  double begin = 0, end = 1;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vector3d along = polygon[(i + 1) % polygon.size()] - polygon[i];
    const Vector3d inward = normal.cross(along).normalized();
    const double from = inward.dot(segment.from - polygon[i]) + slack_mm;
    const double to = inward.dot(segment.to - polygon[i]) + slack_mm;
    if (from < 0 && to < 0) return std::nullopt;
    if (from < 0) begin = std::max(begin, from / (from - to));
    if (to < 0) end = std::min(end, from / (from - to));
  }
  if (begin > end) return std::nullopt;
  const Vector3d way = segment.to - segment.from;
  return Segment{segment.from + begin * way, segment.from + end * way};
}

class Splitter {
 public:
  Splitter(const TriangleBvh& surface, double tolerance_mm)
      : surface_(surface), mesh_(surface.mesh()), tolerance_mm_(tolerance_mm) {
    partners_.resize(mesh_.triangles.size());
    cutters_.resize(mesh_.triangles.size());
    faces_.resize(mesh_.triangles.size());
  }

  std::optional<TriangleMesh> Split() {
    if (!FindCutters() || !CutFaces()) return std::nullopt;
    return Join();
  }

 private:
  Plane PlaneOf(int32_t face) const {
    return PlaneThrough(mesh_.Corner(face, 0), mesh_.DoubleArea(face));
  }
  Polygon Corners(int32_t face) const {
    return {mesh_.Corner(face, 0), mesh_.Corner(face, 1), mesh_.Corner(face, 2)};
  }
  bool HasPlane(int32_t face) const { return mesh_.DoubleArea(face).norm() > 0; }

  // Part of face `other` in the plane of `face`, clipped to `face`: a segment, or nullopt. If both
  // lie in one plane, the edges of `other`.
  std::vector<Cutter> CuttersBy(int32_t face, int32_t other) const {
    const Plane plane = PlaneOf(face), cutting = PlaneOf(other);
    const Polygon corners = Corners(face), others = Corners(other);
    double height[3];
    int above = 0, below = 0;
    for (int c = 0; c < 3; ++c) {
      height[c] = plane.Height(others[c]);
      if (std::abs(height[c]) <= tolerance_mm_) height[c] = 0;
      above += height[c] > 0 ? 1 : 0;
      below += height[c] < 0 ? 1 : 0;
    }
    std::vector<Cutter> found;
    const auto add = [&](const Plane& by, const Segment& segment) {
      const auto within = Clip(segment, corners, plane.normal, tolerance_mm_);
      // Faces that touch at a point do not cut one another.
      if (within && within->Length() > 4 * tolerance_mm_) found.push_back({by, *within});
    };
    if (above == 0 && below == 0) {
      for (int c = 0; c < 3; ++c) {
        const Segment edge{others[c], others[(c + 1) % 3]};
        add(PlaneThrough(edge.from, plane.normal.cross(edge.to - edge.from)), edge);
      }
      return found;
    }
    if (above == 3 || below == 3) return found;
    std::vector<Vector3d> ends;
    for (int c = 0; c < 3; ++c) {
      const int next = (c + 1) % 3;
      if (height[c] == 0) ends.push_back(others[c]);
      if (height[c] * height[next] < 0) {
        const double share = height[c] / (height[c] - height[next]);
        ends.emplace_back(others[c] + share * (others[next] - others[c]));
      }
    }
    if (ends.size() == 2) add(cutting, {ends[0], ends[1]});
    return found;
  }

  // True if two neighbors meet only in their common edge. Folded neighbors lie on one another.
  bool MeetInEdge(int32_t face, int32_t other) const {
    const auto &one = mesh_.triangles[face], &two = mesh_.triangles[other];
    int common = 0, own = 0, others = 0;
    for (int c = 0; c < 3; ++c) {
      const bool is_common = std::find(two.begin(), two.end(), one[c]) != two.end();
      common += is_common ? 1 : 0;
      if (!is_common) own = c;
      if (std::find(one.begin(), one.end(), two[c]) == one.end()) others = c;
    }
    if (common != 2) return false;
    const Plane plane = PlaneOf(face);
    const Vector3d tip = mesh_.Corner(other, others);
    if (std::abs(plane.Height(tip)) > tolerance_mm_) return true;
    const Vector3d from = mesh_.Corner(face, (own + 1) % 3);
    const Vector3d inward = plane.normal.cross(Vector3d(mesh_.Corner(face, (own + 2) % 3) - from));
    return inward.dot(tip - from) <= 0;
  }

  // False if there are too many cutters.
  bool FindCutters() {
    size_t cuts = 0;  // half the sum of squares over the faces, as the pieces may grow
    std::vector<int32_t> near;
    for (int32_t face = 0; face < static_cast<int32_t>(mesh_.triangles.size()); ++face) {
      if (!HasPlane(face)) continue;
      Eigen::AlignedBox3d box;
      for (int c = 0; c < 3; ++c) box.extend(mesh_.Corner(face, c));
      surface_.FindTouching(box, near);
      for (const int32_t other : near) {
        if (other <= face || !HasPlane(other) || MeetInEdge(face, other)) continue;
        std::vector<Cutter> mine = CuttersBy(face, other), theirs = CuttersBy(other, face);
        if (mine.empty() && theirs.empty()) continue;
        partners_[face].push_back(other);
        partners_[other].push_back(face);
        std::move(mine.begin(), mine.end(), std::back_inserter(cutters_[face]));
        std::move(theirs.begin(), theirs.end(), std::back_inserter(cutters_[other]));
        cuts += cutters_[face].size() + cutters_[other].size();
        if (cuts > kMostCuts + 10 * mesh_.triangles.size()) return false;
      }
    }
    return true;
  }

  // Adds both sides of a polygon to `pieces`, or the polygon itself if the plane only touches it.
  void CutPolygon(const Polygon& polygon, const Plane& plane, std::vector<Polygon>& pieces) const {
    std::vector<double> height(polygon.size());
    bool above = false, below = false;
    for (size_t i = 0; i < polygon.size(); ++i) {
      height[i] = plane.Height(polygon[i]);
      if (std::abs(height[i]) <= tolerance_mm_) height[i] = 0;
      above = above || height[i] > 0;
      below = below || height[i] < 0;
    }
    if (!above || !below) {
      pieces.push_back(polygon);
      return;
    }
    Polygon up, down;
    for (size_t i = 0; i < polygon.size(); ++i) {
      const size_t next = (i + 1) % polygon.size();
      if (height[i] >= 0) up.push_back(polygon[i]);
      if (height[i] <= 0) down.push_back(polygon[i]);
      if (height[i] * height[next] < 0) {
        const double share = height[i] / (height[i] - height[next]);
        up.emplace_back(polygon[i] + share * (polygon[next] - polygon[i]));
        down.push_back(up.back());
      }
    }
    pieces.push_back(std::move(up));
    pieces.push_back(std::move(down));
  }

  // False if there are too many pieces.
  bool CutFaces() {
    const size_t most = kMostPieces + kMostPiecesPerFace * mesh_.triangles.size();
    size_t count = 0;
    for (const Vector3d& vertex : mesh_.vertices_mm) own_number_.push_back(welder_.Add(vertex));
    for (int32_t face = 0; face < static_cast<int32_t>(mesh_.triangles.size()); ++face) {
      std::vector<std::vector<int32_t>>& numbered = faces_[face];
      const auto& triangle = mesh_.triangles[face];
      if (cutters_[face].empty()) {
        numbered.push_back(
            {own_number_[triangle[0]], own_number_[triangle[1]], own_number_[triangle[2]]});
        continue;
      }
      const Vector3d normal = PlaneOf(face).normal;
      std::vector<Polygon> pieces{Corners(face)}, next;
      for (const Cutter& cutter : cutters_[face]) {
        next.clear();
        for (const Polygon& piece : pieces) {
          if (Clip(cutter.segment, piece, normal, tolerance_mm_)) {
            CutPolygon(piece, cutter.plane, next);
          } else {
            next.push_back(piece);
          }
        }
        pieces.swap(next);
      }
      for (const Polygon& piece : pieces) {
        std::vector<int32_t> numbers;
        for (const Vector3d& corner : piece) numbers.push_back(welder_.Add(corner));
        numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
        while (numbers.size() > 1 && numbers.front() == numbers.back()) numbers.pop_back();
        if (numbers.size() >= 3) numbered.push_back(std::move(numbers));
      }
      count += numbered.size();
      if (count > most) return false;
    }
    return true;
  }

  void AddCorners(int32_t face, std::vector<int32_t>& corners) const {
    for (const auto& piece : faces_[face]) {
      corners.insert(corners.end(), piece.begin(), piece.end());
    }
  }

  // The piece with the corners that lie on its edges. corners: sorted by coordinate `axis`.
  std::vector<int32_t> WithCornersOnEdges(const std::vector<int32_t>& piece,
                                          const std::vector<int32_t>& corners, int axis) const {
    const std::vector<Vector3d>& points = welder_.points_mm();
    const double slack = 4 * tolerance_mm_;
    std::vector<int32_t> whole;
    std::vector<std::pair<double, int32_t>> between;
    for (size_t i = 0; i < piece.size(); ++i) {
      const int32_t a = piece[i], b = piece[(i + 1) % piece.size()];
      const Vector3d way = points[b] - points[a];
      const double length = way.norm();
      between.clear();
      const auto [low, high] = std::minmax(points[a][axis], points[b][axis]);
      const auto first = std::lower_bound(
          corners.begin(), corners.end(), low - slack,
          [&](int32_t corner, double value) { return points[corner][axis] < value; });
      for (auto next = first; next != corners.end(); ++next) {
        const int32_t c = *next;
        if (points[c][axis] > high + slack) break;
        if (c == a || c == b) continue;
        const Vector3d off = points[c] - points[a];
        const double along = off.dot(way) / length;
        if (along <= 0 || along >= length) continue;
        if ((off - along / length * way).norm() <= slack) between.emplace_back(along, c);
      }
      std::sort(between.begin(), between.end());
      whole.push_back(a);
      for (const auto& [along, c] : between) whole.push_back(c);
    }
    return whole;
  }

  // A corner of one piece on the edge of another becomes a corner of both. Pieces then meet in
  // whole edges.
  TriangleMesh Join() {
    std::vector<std::vector<int32_t>> neighbors(mesh_.triangles.size());
    for (const auto& [one, two] : repair::Neighbors(mesh_)) {
      neighbors[one].push_back(two);
      neighbors[two].push_back(one);
    }
    std::vector<std::vector<int32_t>> whole;
    for (int32_t face = 0; face < static_cast<int32_t>(mesh_.triangles.size()); ++face) {
      const auto is_cut = [&](int32_t f) { return !partners_[f].empty(); };
      const bool touched =
          is_cut(face) || std::any_of(neighbors[face].begin(), neighbors[face].end(), is_cut);
      if (!touched) {
        whole.push_back(faces_[face].front());
        continue;
      }
      std::vector<int32_t> corners;
      AddCorners(face, corners);
      for (const int32_t n : neighbors[face]) AddCorners(n, corners);
      for (const int32_t p : partners_[face]) AddCorners(p, corners);
      std::sort(corners.begin(), corners.end());
      corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
      const std::vector<Vector3d>& points = welder_.points_mm();
      Eigen::AlignedBox3d box;
      for (int c = 0; c < 3; ++c) box.extend(mesh_.Corner(face, c));
      int axis = 0;
      box.sizes().maxCoeff(&axis);
      std::stable_sort(corners.begin(), corners.end(),
                       [&](int32_t a, int32_t b) { return points[a][axis] < points[b][axis]; });
      for (const auto& piece : faces_[face]) {
        whole.push_back(WithCornersOnEdges(piece, corners, axis));
      }
    }
    return Triangulate(whole);
  }

  // Fans about the middle: the same for two pieces that lie on one another, and valid for collinear
  // corners.
  TriangleMesh Triangulate(const std::vector<std::vector<int32_t>>& polygons) {
    TriangleMesh split;
    for (const auto& polygon : polygons) {
      if (polygon.size() == 3) {
        split.triangles.push_back({polygon[0], polygon[1], polygon[2]});
        continue;
      }
      std::vector<int32_t> sorted = polygon;
      std::sort(sorted.begin(), sorted.end());
      Vector3d middle = Vector3d::Zero();
      for (const int32_t corner : sorted) middle += welder_.points_mm()[corner];
      const int32_t center = welder_.Add(middle / static_cast<double>(sorted.size()));
      for (size_t i = 0; i < polygon.size(); ++i) {
        const int32_t a = polygon[i], b = polygon[(i + 1) % polygon.size()];
        if (a != center && b != center) split.triangles.push_back({a, b, center});
      }
    }
    split.vertices_mm = welder_.Take();
    return split;
  }

  const TriangleBvh& surface_;
  const TriangleMesh& mesh_;
  double tolerance_mm_;
  std::vector<std::vector<int32_t>> partners_;  // per face: the faces that it meets
  std::vector<std::vector<Cutter>> cutters_;
  VertexWelder welder_{2 * tolerance_mm_};
  std::vector<int32_t> own_number_;                       // number of each vertex of the surface
  std::vector<std::vector<std::vector<int32_t>>> faces_;  // per face: its pieces
};

}  // namespace

std::optional<TriangleMesh> SplitAtIntersections(const TriangleBvh& surface, double tolerance_mm) {
  return Splitter(surface, tolerance_mm).Split();
}

}  // namespace torquer::vessel
