// The steps by which a dirty triangle mesh becomes a clean closed one. Each says what it found in
// the report, or throws UserError that begins with `name`.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel::repair {

/// Vertices within tolerance_mm of one another become one; unused ones go.
void Weld(TriangleMesh& mesh, double tolerance_mm, MeshReport& report);

/// Takes out triangles that repeat a vertex or another triangle.
void DropUseless(TriangleMesh& mesh, MeshReport& report);

/// Takes out parts, joined to the rest by nothing or by an edge of more than two faces, whose area
/// is negligible (under 0.1 % of the largest part's).
void DropFragments(TriangleMesh& mesh, MeshReport& report);

/// Gives neighbors one orientation. Throws on a one-sided surface.
void Orient(TriangleMesh& mesh, const std::string& name, MeshReport& report);

/// Turns the longest edge of faces flatter than tolerance_mm, so that every face has a normal.
void MendSlivers(TriangleMesh& mesh, double tolerance_mm, MeshReport& report);

/// Turns parts of negative volume, open ones by the cone over their border.
void PointOutward(TriangleMesh& mesh, MeshReport& report);

/// Counts and reports the edges of four or more faces that are run through as often one way as the
/// other.
void CountCrossedEdges(const TriangleMesh& mesh, MeshReport& report);

/// Triangles at edges that are run through more often one way than the other: where a surface ends
/// or does not separate two sides.
std::vector<int32_t> FacesAtUnbalancedEdges(const TriangleMesh& mesh);

/// Pairs of triangles that share an edge.
std::vector<std::array<int32_t, 2>> Neighbors(const TriangleMesh& mesh);

/// Takes out vertices that no triangle has.
void DropUnusedVertices(TriangleMesh& mesh);

/// Parts of a mesh: for every triangle the index of its part, joined over edges of two faces.
std::vector<int> Parts(const TriangleMesh& mesh, int* count);

/// Edges, as pairs of vertices, that a closed surface does not have.
struct EdgeFaults {
  std::vector<std::array<int32_t, 2>> open;     ///< of one triangle
  std::vector<std::array<int32_t, 2>> several;  ///< of more than two
  size_t disagreeing = 0;                       ///< of two that are oriented against each other
};
EdgeFaults FindEdgeFaults(const TriangleMesh& mesh);

/// "(1.2, 3.4, 5.6) mm", for messages.
std::string Place(const Eigen::Vector3d& point_mm);
/// "(0.707, -0.707, 0)", for messages.
std::string Direction(const Eigen::Vector3d& unit);
/// "1 hole" or "2 holes", for messages.
std::string Count(size_t count, const std::string& singular, const std::string& plural);
/// A number with up to four digits, for messages.
std::string Number(double value);

}  // namespace torquer::vessel::repair
