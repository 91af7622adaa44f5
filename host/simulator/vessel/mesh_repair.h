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

/// Closes every boundary loop with a fan about its center; large loops are openings. Throws on a
/// large loop that is no end of a tube (far from flat).
void CapLoops(TriangleMesh& mesh, const std::string& name, MeshReport& report);

/// Turns the longest edge of faces flatter than tolerance_mm, so that every face has a normal.
void MendSlivers(TriangleMesh& mesh, double tolerance_mm, MeshReport& report);

/// Turns parts of negative volume. Throws where an edge of several faces has no two sides.
void PointOutward(TriangleMesh& mesh, const std::string& name, MeshReport& report);

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
/// A number with up to four digits, for messages.
std::string Number(double value);

}  // namespace torquer::vessel::repair
