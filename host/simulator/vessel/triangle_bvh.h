// Exact signed distance to a closed triangle mesh.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "host/simulator/vessel/distance_source.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

class EdgeTable;

/// Distances to a mesh by a tree of boxes.
///
/// The sign is that of the angle-weighted pseudonormal of the nearest face, edge or vertex
/// (Baerentzen & Aanaes 2005). Near edges without exactly two faces, slivers and
/// self-intersections, it comes from the winding number (inside above 1/2). Among equally near
/// triangles the lowest index counts, so every result depends on the point alone.
class TriangleBvh final : public DistanceSource {
 public:
  /// kNone omits the preparation of signs, which takes as long as the tree. Distance, SampleGrid
  /// and IsDoubtful must then not be called.
  enum class Signs : std::uint8_t { kNone, kKnown };

  /// mesh: closed (every edge has equally many uses in both directions), outward normals, at least
  /// one triangle.
  explicit TriangleBvh(TriangleMesh mesh, Signs signs = Signs::kKnown);

  double Distance(const Eigen::Vector3d& point_mm) const override;
  void SampleGrid(const double* x, const double* y, const double* z, int count, double needed_mm,
                  double* distances) const override;

  const TriangleMesh& mesh() const { return mesh_; }

  /// Nearest point of the surface and its triangle.
  struct Nearest {
    double distance_mm = 0;  ///< unsigned
    int32_t triangle = -1;
    Eigen::Vector3d point_mm;
  };
  Nearest NearestTo(const Eigen::Vector3d& point_mm) const;

  /// Distance along a unit direction to the first triangle hit beyond least_mm; infinity if none.
  double CastRay(const Eigen::Vector3d& from_mm, const Eigen::Vector3d& direction,
                 double least_mm) const;

  /// True if a ray along a unit direction meets a triangle of a part beyond `least_mm`. `parts`:
  /// index of the part of every triangle.
  bool RayMeetsPart(const Eigen::Vector3d& from_mm, const Eigen::Vector3d& direction,
                    double least_mm, const std::vector<int>& parts, int part) const;

  /// Winding number of the surface about a point: 1 inside a simple surface, 0 outside.
  double WindingNumber(const Eigen::Vector3d& point_mm) const;

  /// Winding numbers on both sides of a face, rounded to integers.
  struct WholeSides {
    long outer, inner;
    bool operator==(const WholeSides&) const = default;
  };
  /// Rounds the winding numbers at point + step and point - step, where the step is much shorter
  /// than the face. It walks once for both, with coarser dipoles as long as these suffice.
  WholeSides WholeWindingNumbers(const Eigen::Vector3d& point_mm,
                                 const Eigen::Vector3d& step_mm) const;

  /// The same by counting the triangles that a ray crosses, which is much quicker. `lid`: few
  /// triangles that close the surface; null for a closed one. Returns nullopt if the ray passes
  /// too close to an edge, or if a number is far from an integer.
  std::optional<WholeSides> CountCrossings(const Eigen::Vector3d& point_mm,
                                           const Eigen::Vector3d& step_mm,
                                           const TriangleBvh* lid) const;

  /// Finds the triangles with boxes that touch a box.
  void FindTouching(const Eigen::AlignedBox3d& box, std::vector<int32_t>& triangles) const;

  /// Pairs of triangles that cut through one another, at most `limit` of them. Triangles that share
  /// a vertex are not tested.
  std::vector<std::pair<int32_t, int32_t>> FindIntersections(size_t limit) const;

  /// True if the sign near a triangle comes from the winding number.
  bool IsDoubtful(int32_t triangle) const { return faces_[triangle].doubtful; }

 private:
  static constexpr int kStackDepth = 128;
  // Boxes are skipped only if they are further than the best by more than rounding. Thus a search
  // in any order meets every triangle that could be the nearest.
  static constexpr double kSlack = 1 + 1e-9;

  struct Face {
    Eigen::Vector3d a, ab, ac, normal;
    double ab_ab, ab_ac, ac_ac, determinant;
    bool doubtful = false;
  };
  // Pseudonormals, which only signs need.
  struct Pseudonormals {
    Eigen::Vector3d corner[3];
    Eigen::Vector3d edge[3];  // ab, bc, ca
  };
  struct Node {
    Eigen::AlignedBox3d box;
    int32_t first = 0, count = 0;  // leaf: its triangles; inner node: first is the right child
    // For distant winding numbers: summed area vectors about their mean place.
    Eigen::Vector3d area = Eigen::Vector3d::Zero(), place = Eigen::Vector3d::Zero();
    double reach = 0;
  };
  // The nearest point of one triangle: feature 0 face, 1-3 edges ab bc ca, 4-6 corners.
  struct Hit {
    double squared = std::numeric_limits<double>::infinity();
    int32_t triangle = -1;
    int feature = 0;
    Eigen::Vector3d from = Eigen::Vector3d::Zero();  // from the nearest point to p

    bool Beats(const Hit& other) const {
      return squared < other.squared || (squared == other.squared && triangle < other.triangle);
    }
  };

  // Candidate for the nearest triangle about a center, with its distance's tangent there.
  struct Candidate {
    double distance;
    Eigen::Vector3d gradient;
    int32_t triangle;
  };

  int32_t BuildNode(int32_t first, int32_t count, const std::vector<Eigen::AlignedBox3d>& boxes,
                    const std::vector<Eigen::Vector3d>& centers);
  void FindNormals(const EdgeTable& edges);
  void MarkDoubtful(const EdgeTable& edges);
  std::optional<long> CrossingsOf(const Eigen::Vector3d& from_mm, const Eigen::Vector3d& direction,
                                  double length_mm) const;
  std::pair<double, double> WindingNumbersBeside(const Eigen::Vector3d& point_mm,
                                                 const Eigen::Vector3d& step_mm,
                                                 double dipole_ratio) const;
  // Walks down the tree into nodes for which `enters` is true. Calls `leaf` with each triangle
  // there, until it returns false.
  template <typename Enters, typename Leaf>
  void Walk(Enters enters, Leaf leaf) const;
  // The same for nodes on a ray beyond least_mm and not farther than `nearest`; `leaf` may lower
  // it.
  template <typename Leaf>
  void WalkBoxesOnRay(const Eigen::Vector3d& from_mm, const Eigen::Vector3d& direction,
                      double least_mm, const double& nearest, Leaf leaf) const;
  template <typename Met>
  void WalkRay(const Eigen::Vector3d& from_mm, const Eigen::Vector3d& direction, double least_mm,
               const double& nearest, Met met) const;
  inline void Look(int32_t triangle, const Eigen::Vector3d& p, Hit& hit) const;
  // The triangle `guess` is only where the search begins.
  Hit Search(const Eigen::Vector3d& p, int32_t guess = 0) const;
  Hit SearchAmong(const std::vector<Candidate>& candidates, const Eigen::Vector3d& p,
                  const Eigen::Vector3d& off, int32_t guess) const;
  bool Gather(const Eigen::Vector3d& p, double limit_mm, std::vector<Candidate>& candidates) const;
  double Signed(const Eigen::Vector3d& p, const Hit& hit) const;

  TriangleMesh mesh_;
  Signs signs_;
  std::vector<Face> faces_;
  std::vector<Pseudonormals> pseudonormals_;  // per face; none without signs
  std::vector<Node> nodes_;
  std::vector<int32_t> order_;  // triangles, leaf by leaf
};

template <typename Enters, typename Leaf>
void TriangleBvh::Walk(Enters enters, Leaf leaf) const {
  int32_t stack[kStackDepth];
  int size = 0;
  stack[size++] = 0;
  while (size > 0) {
    const int32_t index = stack[--size];
    const Node& node = nodes_[index];
    if (!enters(node)) continue;
    if (node.count == 0) {
      stack[size++] = node.first;
      stack[size++] = index + 1;
      continue;
    }
    for (int32_t i = node.first; i < node.first + node.count; ++i) {
      if (!leaf(order_[i])) return;
    }
  }
}

template <typename Leaf>
void TriangleBvh::WalkBoxesOnRay(const Eigen::Vector3d& from_mm, const Eigen::Vector3d& direction,
                                 double least_mm, const double& nearest, Leaf leaf) const {
  const Eigen::Vector3d inverse = direction.cwiseInverse();
  const auto enters = [&](const Node& node) {
    double enter = least_mm, leave = nearest;
    for (int axis = 0; axis < 3; ++axis) {
      double t0 = (node.box.min()[axis] - from_mm[axis]) * inverse[axis];
      double t1 = (node.box.max()[axis] - from_mm[axis]) * inverse[axis];
      if (t0 > t1) std::swap(t0, t1);
      // A comparison with NaN (ray on a face, along it) keeps the box.
      enter = t0 > enter ? t0 : enter;
      leave = t1 < leave ? t1 : leave;
    }
    return !(enter > leave * kSlack);
  };
  Walk(enters, leaf);
}

}  // namespace torquer::vessel
