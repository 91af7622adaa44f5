#include "host/simulator/vessel/triangle_bvh.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "host/simulator/vessel/mesh_edges.h"

namespace torquer::vessel {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

namespace {

constexpr int kLeafTriangles = 4;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRoundingMm = 1e-9;
// Least height of a face with a reliable normal, as a share of its longest edge.
constexpr double kSliver = 1e-3;
double SquaredDistance(const AlignedBox3d& box, const Vector3d& p) {
  return (box.min() - p).cwiseMax(p - box.max()).cwiseMax(0).squaredNorm();
}

}  // namespace

TriangleBvh::TriangleBvh(TriangleMesh mesh, Signs signs) : mesh_(std::move(mesh)), signs_(signs) {
  const auto count = static_cast<int32_t>(mesh_.triangles.size());
  assert(count > 0);
  std::vector<AlignedBox3d> boxes(count);
  std::vector<Vector3d> centers(count);
  faces_.resize(count);
  for (int32_t i = 0; i < count; ++i) {
    for (int corner = 0; corner < 3; ++corner) boxes[i].extend(mesh_.Corner(i, corner));
    centers[i] = boxes[i].center();
    Face& face = faces_[i];
    face.a = mesh_.Corner(i, 0);
    face.ab = mesh_.Corner(i, 1) - face.a;
    face.ac = mesh_.Corner(i, 2) - face.a;
    face.ab_ab = face.ab.squaredNorm();
    face.ab_ac = face.ab.dot(face.ac);
    face.ac_ac = face.ac.squaredNorm();
    face.determinant = face.ab_ab * face.ac_ac - face.ab_ac * face.ab_ac;
    face.normal = face.ab.cross(face.ac).normalized();
  }
  order_.resize(count);
  std::iota(order_.begin(), order_.end(), 0);
  nodes_.reserve(2 * count);
  BuildNode(0, count, boxes, centers);
  if (signs_ == Signs::kNone) return;
  const EdgeTable edges(mesh_);
  FindNormals(edges);
  MarkDoubtful(edges);
}

// Splits at the median along the longest side of the centers' box. On surfaces this is as good as a
// costlier rule, for a tree that is built once.
int32_t TriangleBvh::BuildNode(int32_t first, int32_t count, const std::vector<AlignedBox3d>& boxes,
                               const std::vector<Vector3d>& centers) {
  const auto index = static_cast<int32_t>(nodes_.size());
  nodes_.emplace_back();
  Node node;
  AlignedBox3d center_box;
  double area = 0;
  for (int32_t i = first; i < first + count; ++i) {
    const int32_t triangle = order_[i];
    node.box.extend(boxes[triangle]);
    center_box.extend(centers[triangle]);
    const Vector3d twice = mesh_.DoubleArea(triangle);
    node.area += twice / 2;
    node.place += twice.norm() * mesh_.Centroid(triangle);
    area += twice.norm();
  }
  node.place = area > 0 ? Vector3d(node.place / area) : node.box.center();
  node.reach = (node.box.max() - node.place).cwiseMax(node.place - node.box.min()).norm();
  node.first = first;
  node.count = count;
  if (count > kLeafTriangles) {
    int axis = 0;
    center_box.sizes().maxCoeff(&axis);
    const int32_t half = count / 2;
    std::nth_element(
        order_.begin() + first, order_.begin() + first + half, order_.begin() + first + count,
        [&](int32_t a, int32_t b) {
          return centers[a][axis] != centers[b][axis] ? centers[a][axis] < centers[b][axis] : a < b;
        });
    BuildNode(first, half, boxes, centers);
    node.first = BuildNode(first + half, count - half, boxes, centers);
    node.count = 0;
  }
  nodes_[index] = node;
  return index;
}

void TriangleBvh::FindNormals(const EdgeTable& edges) {
  pseudonormals_.resize(faces_.size());
  std::vector<Vector3d> corners(mesh_.vertices_mm.size(), Vector3d::Zero());
  for (size_t i = 0; i < faces_.size(); ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto& triangle = mesh_.triangles[i];
      const int next = (corner + 1) % 3, last = (corner + 2) % 3;
      const Vector3d out = mesh_.Corner(i, next) - mesh_.Corner(i, corner);
      const Vector3d back = mesh_.Corner(i, last) - mesh_.Corner(i, corner);
      const double angle = std::atan2(out.cross(back).norm(), out.dot(back));
      corners[triangle[corner]] += angle * faces_[i].normal;
    }
  }
  for (const auto& [edge, uses] : edges) {
    Vector3d sum = Vector3d::Zero();
    for (const EdgeUse& use : uses) sum += faces_[use.triangle].normal;
    for (const EdgeUse& use : uses) pseudonormals_[use.triangle].edge[use.corner] = sum;
  }
  for (size_t i = 0; i < faces_.size(); ++i) {
    const auto& triangle = mesh_.triangles[i];
    for (int corner = 0; corner < 3; ++corner) {
      pseudonormals_[i].corner[corner] = corners[triangle[corner]];
    }
  }
}

void TriangleBvh::MarkDoubtful(const EdgeTable& edges) {
  std::vector<char> bad_vertex(mesh_.vertices_mm.size(), 0);
  const auto mark = [&](size_t triangle) {
    for (const int32_t vertex : mesh_.triangles[triangle]) bad_vertex[vertex] = 1;
  };
  for (const auto& [edge, uses] : edges) {
    if (uses.size() != 2) bad_vertex[edge.first] = bad_vertex[edge.second] = 1;
  }
  for (size_t i = 0; i < faces_.size(); ++i) {
    const Face& face = faces_[i];
    const double longest = std::max({face.ab_ab, face.ac_ac, (face.ac - face.ab).squaredNorm()});
    if (!(std::sqrt(std::max(0.0, face.determinant)) > kSliver * longest)) mark(i);
  }
  for (const auto& [one, other] : FindIntersections(faces_.size())) {
    mark(one);
    mark(other);
  }
  for (size_t i = 0; i < faces_.size(); ++i) {
    for (const int32_t vertex : mesh_.triangles[i]) {
      faces_[i].doubtful = faces_[i].doubtful || bad_vertex[vertex] != 0;
    }
  }
}

inline void TriangleBvh::Look(int32_t triangle, const Vector3d& p, Hit& hit) const {
  const Face& face = faces_[triangle];
  hit.triangle = triangle;
  const Vector3d d = p - face.a;
  const double d_ab = d.dot(face.ab), d_ac = d.dot(face.ac);
  const double s = face.ac_ac * d_ab - face.ab_ac * d_ac;
  const double t = face.ab_ab * d_ac - face.ab_ac * d_ab;
  if (s >= 0 && t >= 0 && s + t <= face.determinant && face.determinant > 0) {
    const double height = d.dot(face.normal);
    hit.squared = height * height;
    hit.feature = 0;
    hit.from = height * face.normal;
    return;
  }
  hit.squared = kInfinity;
  // The nearest point lies on an edge that has p on its outer side.
  const auto edge = [&](const Vector3d& start, const Vector3d& along, double length2,
                        double projection, int feature, int start_corner, int end_corner) {
    Vector3d from;
    if (!(projection > 0)) {
      from = start;
      feature = start_corner;
    } else if (projection >= length2) {
      from = start - along;
      feature = end_corner;
    } else {
      from = start - (projection / length2) * along;
    }
    const double squared = from.squaredNorm();
    if (squared < hit.squared) {
      hit.squared = squared;
      hit.feature = feature;
      hit.from = from;
    }
  };
  const bool flat = !(face.determinant > 0);
  if (t < 0 || flat) edge(d, face.ab, face.ab_ab, d_ab, 1, 4, 5);
  if (s < 0 || flat) edge(d, face.ac, face.ac_ac, d_ac, 3, 4, 6);
  if (s + t > face.determinant || flat) {
    const Vector3d bc = face.ac - face.ab;
    edge(d - face.ab, bc, bc.squaredNorm(), d_ac - d_ab - face.ab_ac + face.ab_ab, 2, 5, 6);
  }
}

TriangleBvh::Hit TriangleBvh::Search(const Vector3d& p, int32_t guess) const {
  struct Waiting {
    int32_t node;
    double squared;
  };
  Waiting stack[kStackDepth];
  int size = 0;
  stack[size++] = {0, 0};
  Hit best, hit;
  Look(guess, p, best);
  while (size > 0) {
    const Waiting waiting = stack[--size];
    if (waiting.squared > best.squared * kSlack) continue;
    const Node& node = nodes_[waiting.node];
    if (node.count > 0) {
      for (int32_t i = node.first; i < node.first + node.count; ++i) {
        Look(order_[i], p, hit);
        if (hit.Beats(best)) best = hit;
      }
      continue;
    }
    Waiting left{waiting.node + 1, SquaredDistance(nodes_[waiting.node + 1].box, p)};
    Waiting right{node.first, SquaredDistance(nodes_[node.first].box, p)};
    if (left.squared < right.squared) std::swap(left, right);
    stack[size++] = left;
    stack[size++] = right;
  }
  return best;
}

double TriangleBvh::Signed(const Vector3d& p, const Hit& hit) const {
  assert(signs_ == Signs::kKnown);
  const Face& face = faces_[hit.triangle];
  const double distance = std::sqrt(hit.squared);
  if (face.doubtful) return WindingNumber(p) > 0.5 ? distance : -distance;
  const Pseudonormals& others = pseudonormals_[hit.triangle];
  const Vector3d& normal = hit.feature == 0   ? face.normal
                           : hit.feature <= 3 ? others.edge[hit.feature - 1]
                                              : others.corner[hit.feature - 4];
  return hit.from.dot(normal) <= 0 ? distance : -distance;
}

double TriangleBvh::Distance(const Vector3d& point_mm) const {
  return Signed(point_mm, Search(point_mm));
}

TriangleBvh::Nearest TriangleBvh::NearestTo(const Vector3d& point_mm) const {
  const Hit hit = Search(point_mm);
  return {std::sqrt(hit.squared), hit.triangle, point_mm - hit.from};
}

// Few triangles can be nearest to the samples of a block. Their distance from its center exceeds
// the least one by at most the block's diagonal. The distance to a triangle is convex, so it is
// nowhere below its tangent at the center. The tangent is a cheap lower bound. A block that lies
// beyond needed_mm as a whole gets the distance of its center.
void TriangleBvh::SampleGrid(const double* x, const double* y, const double* z, int count,
                             double needed_mm, double* distances) const {
  constexpr int kBlock = 4;
  thread_local std::vector<Candidate> candidates;
  int32_t last = 0;  // nearest triangle of the sample before: a first guess
  for (int k0 = 0; k0 < count; k0 += kBlock) {
    for (int j0 = 0; j0 < count; j0 += kBlock) {
      for (int i0 = 0; i0 < count; i0 += kBlock) {
        const int i1 = std::min(i0 + kBlock, count), j1 = std::min(j0 + kBlock, count),
                  k1 = std::min(k0 + kBlock, count);
        const Vector3d low(x[i0], y[j0], z[k0]), high(x[i1 - 1], y[j1 - 1], z[k1 - 1]);
        const Vector3d center = (low + high) / 2;
        const double diagonal_mm = (high - low).norm();
        const Hit nearest = Search(center, last);
        last = nearest.triangle;
        const double distance_mm = std::sqrt(nearest.squared);
        const bool is_needed = distance_mm - diagonal_mm / 2 <= needed_mm;
        const bool few = is_needed && Gather(center, distance_mm + diagonal_mm, candidates);
        for (int k = k0; k < k1; ++k) {
          for (int j = j0; j < j1; ++j) {
            double* row = distances + (k * count + j) * count;
            if (!is_needed) {
              std::fill(row + i0, row + i1, distance_mm);
              continue;
            }
            for (int i = i0; i < i1; ++i) {
              const Vector3d p(x[i], y[j], z[k]);
              const Hit best = few ? SearchAmong(candidates, p, p - center, last) : Search(p, last);
              last = best.triangle;
              row[i] = Signed(p, best);
            }
          }
        }
      }
    }
  }
}

// The nearest of the candidates and of the triangle `guess` to a point, which lies `off` their
// center.
TriangleBvh::Hit TriangleBvh::SearchAmong(const std::vector<Candidate>& candidates,
                                          const Vector3d& p, const Vector3d& off,
                                          int32_t guess) const {
  Hit best, hit;
  Look(guess, p, best);
  double bound = std::sqrt(best.squared) * kSlack + kRoundingMm;
  for (const Candidate& candidate : candidates) {
    if (candidate.distance + candidate.gradient.dot(off) > bound) continue;
    Look(candidate.triangle, p, hit);
    if (!hit.Beats(best)) continue;
    best = hit;
    bound = std::sqrt(best.squared) * kSlack + kRoundingMm;
  }
  return best;
}

// All triangles within limit_mm of a point, with the tangents of their distances. Returns false and
// no triangle if there are too many: a search for each sample is then quicker.
bool TriangleBvh::Gather(const Vector3d& p, double limit_mm,
                         std::vector<Candidate>& candidates) const {
  constexpr size_t kMost = 400;
  candidates.clear();
  const double limit = limit_mm * kSlack + kRoundingMm;
  Hit hit;
  Walk([&](const Node& node) { return SquaredDistance(node.box, p) <= limit * limit; },
       [&](int32_t triangle) {
         Look(triangle, p, hit);
         const double distance = std::sqrt(hit.squared);
         if (distance > limit) return true;
         Candidate candidate{distance, Vector3d::Zero(), triangle};
         if (distance > 0) candidate.gradient = hit.from / distance;
         candidates.push_back(candidate);
         return candidates.size() <= kMost;
       });
  if (candidates.size() <= kMost) return true;
  candidates.clear();
  return false;
}

// Calls `met` with each triangle on a ray beyond least_mm and its distance, until it returns false.
// Nodes farther than `nearest` are omitted; `met` may lower it.
template <typename Met>
void TriangleBvh::WalkRay(const Vector3d& from_mm, const Vector3d& direction, double least_mm,
                          const double& nearest, Met met) const {
  WalkBoxesOnRay(from_mm, direction, least_mm, nearest, [&](int32_t triangle) {
    // Moeller & Trumbore (1997).
    const Face& face = faces_[triangle];
    const Vector3d h = direction.cross(face.ac);
    const double determinant = face.ab.dot(h);
    if (determinant == 0) return true;
    const Vector3d d = from_mm - face.a;
    const double u = d.dot(h) / determinant;
    if (u < 0 || u > 1) return true;
    const Vector3d q = d.cross(face.ab);
    const double v = direction.dot(q) / determinant;
    if (v < 0 || u + v > 1) return true;
    const double t = face.ac.dot(q) / determinant;
    return !(t > least_mm && t < nearest) || met(triangle, t);
  });
}

double TriangleBvh::CastRay(const Vector3d& from_mm, const Vector3d& direction,
                            double least_mm) const {
  double nearest = kInfinity;
  WalkRay(from_mm, direction, least_mm, nearest, [&](int32_t, double distance_mm) {
    nearest = distance_mm;
    return true;
  });
  return nearest;
}

bool TriangleBvh::RayMeetsPart(const Vector3d& from_mm, const Vector3d& direction, double least_mm,
                               const std::vector<int>& parts, int part) const {
  bool meets = false;
  WalkRay(from_mm, direction, least_mm, kInfinity, [&](int32_t triangle, double) {
    meets = parts[triangle] == part;
    return !meets;
  });
  return meets;
}

void TriangleBvh::FindTouching(const AlignedBox3d& box, std::vector<int32_t>& triangles) const {
  triangles.clear();
  Walk([&](const Node& node) { return node.box.intersects(box); },
       [&](int32_t triangle) {
         const Face& face = faces_[triangle];
         const Vector3d b = face.a + face.ab, c = face.a + face.ac;
         const AlignedBox3d own(face.a.cwiseMin(b).cwiseMin(c), face.a.cwiseMax(b).cwiseMax(c));
         if (box.intersects(own)) triangles.push_back(triangle);
         return true;
       });
}

}  // namespace torquer::vessel
