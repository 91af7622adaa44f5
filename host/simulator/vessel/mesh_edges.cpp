#include "host/simulator/vessel/mesh_edges.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <tuple>

namespace torquer::vessel {

namespace {

struct Side {
  int32_t larger;  // vertex of its edge
  EdgeUse use;
};

// Sides of all triangles, sorted by edge and then by triangle. There is a bucket for each smaller
// vertex, because a tree of all edges would be much slower.
std::vector<Side> SortedSides(const TriangleMesh& mesh, std::vector<std::size_t>& first) {
  const auto of_side = [&mesh](std::size_t i, int corner) {
    return std::pair(mesh.triangles[i][corner], mesh.triangles[i][(corner + 1) % 3]);
  };
  first.assign(mesh.vertices_mm.size() + 1, 0);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto [a, b] = of_side(i, corner);
      ++first[static_cast<std::size_t>(std::min(a, b)) + 1];
    }
  }
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<std::size_t> next = first;
  std::vector<Side> sides(3 * mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto [a, b] = of_side(i, corner);
      sides[next[static_cast<std::size_t>(std::min(a, b))]++] = {
          std::max(a, b), {static_cast<int32_t>(i), corner, a < b}};
    }
  }
  const auto key = [](const Side& side) {
    return std::tuple(side.larger, side.use.triangle, side.use.corner);
  };
  for (std::size_t v = 0; v + 1 < first.size(); ++v) {
    std::sort(sides.begin() + static_cast<std::ptrdiff_t>(first[v]),
              sides.begin() + static_cast<std::ptrdiff_t>(first[v + 1]),
              [&key](const Side& one, const Side& other) { return key(one) < key(other); });
  }
  return sides;
}

}  // namespace

int Balance(std::span<const EdgeUse> uses) {
  int balance = 0;
  for (const EdgeUse& use : uses) balance += use.forward ? 1 : -1;
  return balance;
}

EdgeTable::EdgeTable(const TriangleMesh& mesh) {
  std::vector<std::size_t> first;
  const std::vector<Side> sides = SortedSides(mesh, first);
  uses_.reserve(sides.size());
  for (const Side& side : sides) uses_.push_back(side.use);
  for (std::size_t v = 0; v + 1 < first.size(); ++v) {
    for (std::size_t begin = first[v]; begin < first[v + 1];) {
      std::size_t end = begin + 1;
      while (end < first[v + 1] && sides[end].larger == sides[begin].larger) ++end;
      entries_.push_back({{static_cast<int32_t>(v), sides[begin].larger},
                          std::span(uses_).subspan(begin, end - begin)});
      begin = end;
    }
  }
}

std::span<const EdgeUse> EdgeTable::UsesOf(const Edge& edge) const {
  const auto found =
      std::lower_bound(entries_.begin(), entries_.end(), edge,
                       [](const Entry& entry, const Edge& wanted) { return entry.edge < wanted; });
  if (found == entries_.end() || found->edge != edge) return {};
  return found->uses;
}

}  // namespace torquer::vessel
