// From a surface file as people have it to the closed, outward-oriented wall of a lumen.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// What one unit of a surface file is; declared by the scene, never guessed.
enum class MeshUnit { kMillimeter, kMeter };

/// "mm" or "m" (the scene's mesh_unit). Throws UserError naming both on anything else.
MeshUnit MeshUnitFromText(const std::string& text);

/// An end of the vessel that the file left open: a natural entry point.
struct Opening {
  Eigen::Vector3d center_mm;
  Eigen::Vector3d outward;  ///< unit, across the cut, away from the lumen
  double radius_mm = 0;     ///< of the circle of the same area
  Eigen::Vector3d inward;   ///< unit, along the vessel into the lumen: how a wire would go in
};

/// What was found in a surface and what was done about it.
struct MeshReport {
  std::vector<std::string> findings;  ///< sentences for a person, in the order of the work
  std::vector<Opening> openings;      ///< closed by fans, largest first

  size_t triangles_read = 0;
  size_t vertices_welded = 0;
  size_t triangles_dropped = 0;  ///< degenerate, doubled, or in fragments too small to be vessel
  size_t triangles_turned = 0;   ///< whose orientation disagreed with their neighbors'
  size_t holes_closed = 0;       ///< in the wall, rather than ends
  size_t slivers_repaired = 0;
  size_t crossed_edges = 0;  ///< edges of four or more faces that were kept
  size_t intersections = 0;  ///< pairs of faces that cut through one another
  double left_out_mm2 = 0;   ///< of walls within the lumen and of sheets that enclose nothing
  bool was_inward = false;   ///< normals pointed into the lumen
  bool was_shell = false;    ///< the file held a wall with thickness; its lumen was taken
  /// Share of the surface that looks into a tube: about 0 for a lumen, about 0.4 for a shell.
  double tube_facing_share = 0;

  Eigen::AlignedBox3d bounds_mm;
  double area_mm2 = 0;
  double volume_mm3 = 0;
  /// Wall-to-wall width along inward normals, by area: 5 %, 50 % and 95 % of the surface have less.
  double width_mm[3] = {0, 0, 0};
};

struct SurfaceMesh {
  TriangleMesh mesh;
  MeshReport report;
  TriangleMesh left_out;  ///< walls within the lumen and sheets, as they were
};

/// The unit by which a surface, as its file has it, is of the size of a vessel; none where neither
/// does. For proposals: a scene declares it.
std::optional<MeshUnit> GuessUnit(const TriangleMesh& file);

/// Throws UserError that begins with `name` where a surface in mm has no size of a vessel, or lies
/// so far from the origin that its coordinates are coarse.
void CheckSize(const TriangleMesh& mesh, const std::string& name);

/// Vertices of a surface that are nearer to one another are one, mm.
double WeldToleranceMm(const TriangleMesh& mesh);

/// Reads a surface file and makes it usable. Throws UserError naming the file, what is wrong, where
/// and the remedy for what cannot be repaired.
SurfaceMesh ReadSurface(const std::string& path, MeshUnit unit);

/// The same of the file's bytes; `path` names it in messages, and its ending says the format.
SurfaceMesh ParseSurface(const std::string& contents, const std::string& path, MeshUnit unit);

/// The same from triangles in mm; `name` stands for the file in messages.
SurfaceMesh RepairSurface(TriangleMesh raw, const std::string& name);

}  // namespace torquer::vessel
