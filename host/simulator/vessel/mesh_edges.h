// Edges of a triangle mesh, and the triangles that use them.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Two vertices, the smaller one first.
using Edge = std::pair<int32_t, int32_t>;

/// A triangle's side along an edge.
struct EdgeUse {
  int32_t triangle;
  int corner;    ///< the side runs from this corner to the next
  bool forward;  ///< from the edge's smaller vertex to its larger
};

/// Uses of an edge in one direction less those in the other; 0 in a closed surface.
int Balance(std::span<const EdgeUse> uses);

/// Edges in increasing order, each with its uses in the order of the triangles.
class EdgeTable {
 public:
  struct Entry {
    Edge edge;
    std::span<const EdgeUse> uses;
  };

  explicit EdgeTable(const TriangleMesh& mesh);
  // The entries view the uses.
  EdgeTable(const EdgeTable&) = delete;
  EdgeTable& operator=(const EdgeTable&) = delete;

  std::vector<Entry>::const_iterator begin() const { return entries_.begin(); }
  std::vector<Entry>::const_iterator end() const { return entries_.end(); }
  /// Uses of an edge; none for an edge that the mesh does not have.
  std::span<const EdgeUse> UsesOf(const Edge& edge) const;

 private:
  std::vector<EdgeUse> uses_;
  std::vector<Entry> entries_;
};

}  // namespace torquer::vessel
