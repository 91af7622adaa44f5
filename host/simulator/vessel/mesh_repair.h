// Mesh repair: the steps from a dirty triangle mesh to a clean closed one. Each step adds its
// findings to the report, or throws UserError that begins with `name`.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "host/simulator/vessel/mesh_edges.h"
#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel::repair {

/// Merges vertices within tolerance_mm of one another. Unused vertices stay.
void Weld(TriangleMesh& mesh, double tolerance_mm, MeshReport& report);

/// Removes triangles that repeat a vertex or another triangle.
void DropUseless(TriangleMesh& mesh, MeshReport& report);

/// Removes parts with a negligible area (under 0.1 % of the largest part's). Edges of one face or
/// of more than two faces bound a part.
void DropFragments(TriangleMesh& mesh, MeshReport& report);

/// Gives neighbors one orientation. Throws UserError on a one-sided surface.
void Orient(TriangleMesh& mesh, const std::string& name, MeshReport& report);

/// Flips the longest edge of faces flatter than tolerance_mm, so that every face has a normal.
void MendSlivers(TriangleMesh& mesh, double tolerance_mm, MeshReport& report);

/// Turns parts of negative volume; an open part is closed by the cone over its border. Removes
/// unused vertices.
void PointOutward(TriangleMesh& mesh, MeshReport& report);

/// Counts and reports the edges of four or more faces with equally many uses in both directions.
void CountCrossedEdges(const TriangleMesh& mesh, MeshReport& report);

/// Triangles at edges with more uses in one direction than in the other. The surface ends there, or
/// does not separate two sides.
std::vector<int32_t> FacesAtUnbalancedEdges(const TriangleMesh& mesh);

/// Triangles that balance every edge of a mesh: a cone over each connected part of its border.
/// Empty for a closed mesh.
TriangleMesh ConesOverBorder(const TriangleMesh& mesh);

/// Pairs of triangles that share an edge.
std::vector<std::array<int32_t, 2>> Neighbors(const TriangleMesh& mesh);

/// Removes vertices that no triangle has.
void DropUnusedVertices(TriangleMesh& mesh);

/// Index of the part of every triangle, joined over edges of two faces. count: number of parts.
std::vector<int> Parts(const TriangleMesh& mesh, int* count);
/// The same with the edges of the mesh.
std::vector<int> Parts(const TriangleMesh& mesh, const EdgeTable& edges, int* count);

/// Edges, as pairs of vertices, that a closed surface must not have.
struct EdgeFaults {
  std::vector<std::array<int32_t, 2>> open;     ///< of one triangle
  std::vector<std::array<int32_t, 2>> several;  ///< of more than two
  size_t disagreeing = 0;                       ///< of two with opposite orientations
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
