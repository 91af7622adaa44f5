// Surface mesh: from an arbitrary surface file to the closed, outward-oriented wall of a lumen.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/vessel/length_unit.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Unit of a surface file; declared by the scene, never guessed.
enum class MeshUnit { kMillimeter, kMeter, kCentimeter, kMicrometer, kInch };

/// Name and length of a unit.
const LengthUnit& UnitOf(MeshUnit unit);

/// Opening: an end of the vessel that the file left open, a natural entry point.
struct Opening {
  Eigen::Vector3d center_mm;
  Eigen::Vector3d outward;  ///< unit, across the cut, away from the lumen
  double radius_mm = 0;     ///< of the circle of the same area
  Eigen::Vector3d inward;   ///< unit, along the vessel into the lumen, as a wire would enter
};

/// Findings in a surface, and the repairs.
struct MeshReport {
  std::vector<std::string> findings;  ///< sentences for a person, in the order of the steps
  std::vector<Opening> openings;      ///< closed by fans, largest first

  size_t triangles_read = 0;
  size_t vertices_welded = 0;
  size_t triangles_dropped = 0;  ///< degenerate, doubled, or in fragments too small for a vessel
  size_t triangles_turned = 0;   ///< orientation disagreed with the neighbors
  size_t holes_closed = 0;       ///< in the wall, without ends
  size_t slivers_repaired = 0;
  size_t crossed_edges = 0;  ///< edges of four or more faces that were kept
  size_t intersections = 0;  ///< pairs of faces that cut through one another
  double left_out_mm2 = 0;   ///< walls within the lumen, and sheets
  bool was_inward = false;   ///< normals pointed into the lumen
  bool was_shell = false;    ///< the file held a wall with thickness; its lumen was taken
  /// Share of the surface that looks into a tube: about 0 for a lumen, about 0.4 for a shell.
  double tube_facing_share = 0;

  Eigen::AlignedBox3d bounds_mm;
  double area_mm2 = 0;
  double volume_mm3 = 0;
  /// Wall-to-wall widths along inward normals, mm: 5 %, 50 % and 95 % of the area have less.
  double width_mm[3] = {0, 0, 0};
};

struct SurfaceMesh {
  TriangleMesh mesh;
  MeshReport report;
  TriangleMesh left_out;  ///< removed walls within the lumen, and sheets
};

/// Unit in which a surface with its file's coordinates has the size of a vessel. Units are tried in
/// the order of MeshUnit; empty if none fits. Only for proposals: a scene declares its unit.
std::optional<MeshUnit> GuessUnit(const TriangleMesh& file);

/// Throws UserError if the diagonal of a surface, in mm, is outside 5 to 4000 mm. The message
/// begins with `name`, and names the units in which the file's coordinates would be a vessel.
/// `unit`: the declared unit of the file. Also throws if it lies over 1e6 mm from the origin: its
/// coordinates are then coarse.
void CheckSize(const TriangleMesh& mesh, const std::string& name, MeshUnit unit);

/// Weld tolerance, mm: vertices of a surface that are nearer to one another are merged.
double WeldToleranceMm(const TriangleMesh& mesh);

/// Reads and repairs a surface file. If it cannot be repaired, throws UserError naming the file,
/// the fault, the place and the remedy.
SurfaceMesh ReadSurface(const std::string& path, MeshUnit unit);

/// As ReadSurface, from the bytes. `path` names the file in messages; its extension gives the
/// format.
SurfaceMesh ParseSurface(const std::string& contents, const std::string& path, MeshUnit unit);

/// As ReadSurface, from triangles in mm. `name` stands for the file in messages, `unit` for its
/// unit.
SurfaceMesh RepairSurface(TriangleMesh raw, const std::string& name,
                          MeshUnit unit = MeshUnit::kMillimeter);

}  // namespace torquer::vessel
