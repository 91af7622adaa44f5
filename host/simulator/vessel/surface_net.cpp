#include "host/simulator/vessel/surface_net.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

namespace torquer::vessel {
namespace {

using Cell = std::array<int, 3>;

// Cells per side of a block. Most blocks do not meet the surface and need one look-up.
constexpr int kBlock = 8;

class SurfaceNet {
 public:
  SurfaceNet(const ClearanceField& field, const Eigen::AlignedBox3d& bounds_mm, double cell_mm)
      : field_(field),
        cell_mm_(cell_mm),
        // A margin of one cell closes the surface at the bounds.
        origin_mm_(bounds_mm.min() - Eigen::Vector3d::Constant(cell_mm)) {
    for (int axis = 0; axis < 3; ++axis) {
      count_[static_cast<std::size_t>(axis)] =
          static_cast<int>(std::ceil(bounds_mm.sizes()[axis] / cell_mm)) + 2;
    }
  }

  TriangleMesh Build() {
    for (int x = 0; x < count_[0]; x += kBlock) {
      for (int y = 0; y < count_[1]; y += kBlock) {
        for (int z = 0; z < count_[2]; z += kBlock) VisitBlock({x, y, z});
      }
    }
    for (const auto& [corner, axis, inside_first] : crossed_edges_) {
      AddQuadrilateral(corner, axis, inside_first);
    }
    return std::move(mesh_);
  }

 private:
  Eigen::Vector3d PointMm(const Cell& corner) const {
    return origin_mm_ + cell_mm_ * Eigen::Vector3d(corner[0], corner[1], corner[2]);
  }

  void VisitBlock(const Cell& first) {
    const Eigen::Vector3d center =
        PointMm(first) + Eigen::Vector3d::Constant(0.5 * kBlock * cell_mm_);
    // One cell of margin around the block.
    const double reach_mm = 0.5 * std::sqrt(3.0) * (kBlock + 2) * cell_mm_;
    if (std::abs(field_.Clearance(center)) > field_.LipschitzBound() * reach_mm) return;

    constexpr int kCorners = kBlock + 1;
    std::array<double, kCorners * kCorners * kCorners> clearance{};
    const auto at = [&clearance](int x, int y, int z) -> double& {
      return clearance[static_cast<std::size_t>((x * kCorners + y) * kCorners + z)];
    };
    for (int x = 0; x < kCorners; ++x) {
      for (int y = 0; y < kCorners; ++y) {
        for (int z = 0; z < kCorners; ++z) {
          at(x, y, z) = field_.Clearance(PointMm({first[0] + x, first[1] + y, first[2] + z}));
        }
      }
    }
    for (int x = 0; x < kBlock; ++x) {
      for (int y = 0; y < kBlock; ++y) {
        for (int z = 0; z < kBlock; ++z) {
          VisitCell({first[0] + x, first[1] + y, first[2] + z},
                    [&](int dx, int dy, int dz) { return at(x + dx, y + dy, z + dz); });
        }
      }
    }
  }

  // A cell's vertex is the mean of the crossings of its edges. The three edges at its first corner
  // are recorded, so that each edge is recorded once.
  template <class ClearanceAt>
  void VisitCell(const Cell& cell, const ClearanceAt& clearance_at) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int crossings = 0;
    for (int axis = 0; axis < 3; ++axis) {
      for (int other = 0; other < 4; ++other) {
        std::array<int, 3> from{};
        from[static_cast<std::size_t>((axis + 1) % 3)] = other & 1;
        from[static_cast<std::size_t>((axis + 2) % 3)] = other >> 1;
        std::array<int, 3> to = from;
        to[static_cast<std::size_t>(axis)] = 1;
        const double a = clearance_at(from[0], from[1], from[2]);
        const double b = clearance_at(to[0], to[1], to[2]);
        if ((a > 0) == (b > 0)) continue;
        const double share = a / (a - b);
        sum += Eigen::Vector3d(from[0], from[1], from[2]);
        sum[axis] += share;
        ++crossings;
        if (other == 0) crossed_edges_.emplace_back(cell, axis, a > 0);
      }
    }
    if (crossings == 0) return;
    vertices_[cell] = static_cast<std::int32_t>(mesh_.vertices_mm.size());
    mesh_.vertices_mm.emplace_back(PointMm(cell) + cell_mm_ / crossings * sum);
  }

  // Adds a quadrilateral across the edge at `corner`, between the vertices of its four cells.
  void AddQuadrilateral(const Cell& corner, int axis, bool inside_first) {
    const auto u = static_cast<std::size_t>((axis + 1) % 3);
    const auto v = static_cast<std::size_t>((axis + 2) % 3);
    std::array<std::int32_t, 4> around{};
    constexpr std::array<std::array<int, 2>, 4> kBack = {{{1, 1}, {0, 1}, {0, 0}, {1, 0}}};
    for (std::size_t i = 0; i < 4; ++i) {
      Cell cell = corner;
      cell[u] -= kBack[i][0];
      cell[v] -= kBack[i][1];
      const auto vertex = vertices_.find(cell);
      if (vertex == vertices_.end()) return;  // beyond the grid
      around[i] = vertex->second;
    }
    if (!inside_first) std::swap(around[1], around[3]);
    mesh_.triangles.push_back({around[0], around[1], around[2]});
    mesh_.triangles.push_back({around[0], around[2], around[3]});
  }

  const ClearanceField& field_;
  const double cell_mm_;
  const Eigen::Vector3d origin_mm_;
  Cell count_{};
  TriangleMesh mesh_;
  std::map<Cell, std::int32_t> vertices_;  // the vertex in a cell
  std::vector<std::tuple<Cell, int, bool>> crossed_edges_;
};

}  // namespace

TriangleMesh SurfaceOf(const ClearanceField& field, const Eigen::AlignedBox3d& bounds_mm,
                       double cell_mm) {
  assert(cell_mm > 0);
  return SurfaceNet(field, bounds_mm, cell_mm).Build();
}

TriangleMesh SurfaceInAbout(std::size_t triangles, const ClearanceField& field,
                            const Eigen::AlignedBox3d& bounds_mm) {
  const double coarse_mm = bounds_mm.sizes().maxCoeff() / 80;
  TriangleMesh coarse = SurfaceOf(field, bounds_mm, coarse_mm);
  if (coarse.triangles.empty()) return coarse;
  // The number of triangles is proportional to the inverse square of the cell width.
  const double share =
      static_cast<double>(coarse.triangles.size()) / static_cast<double>(triangles);
  return SurfaceOf(field, bounds_mm, coarse_mm * std::sqrt(share));
}

}  // namespace torquer::vessel
