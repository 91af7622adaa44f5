// Mesh check: examines a surface file before a scene names it.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/vessel/mesh_repair.h"
#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Proposed place and direction for an instrument to enter.
struct EntryProposal {
  Eigen::Vector3d point_mm;
  Eigen::Vector3d direction;  ///< unit, along the vessel
  double room_mm = 0;         ///< from the point to the wall
  const char* place = "the widest place";
};

struct MeshCheck {
  std::string path;
  /// Triangles of the file, in mm by `unit`, with coincident vertices made one. Empty if the file
  /// cannot be parsed.
  TriangleMesh raw;
  Eigen::Vector3d size;  ///< of the file's box, in its unit
  size_t triangles_read = 0;
  size_t vertices_welded = 0;
  /// Unit that gives the surface the size of a vessel; empty if neither does.
  std::optional<MeshUnit> unit;
  repair::EdgeFaults edges;
  int components = 0;  ///< parts, joined over edges of two triangles
  /// Repaired surface; empty if it is refused.
  std::optional<SurfaceMesh> surface;
  std::string refusal;  ///< error message of a scene with this surface
  std::vector<EntryProposal>
      entries;  ///< one for each open end, else each flat end, else the widest place
  /// Number of parts of a coarse surface that look like flat ends, if they are too many for a
  /// vessel. Then no flat end is proposed.
  size_t doubtful_ends = 0;
};

/// Checks the bytes of a surface file. `path` names it in messages; its extension gives the format.
/// Throws no UserError: the result has the faults of the file.
MeshCheck CheckMesh(const std::string& contents, const std::string& path);

/// Text of the result for a person, line by line.
std::string DescribeCheck(const MeshCheck& check);

/// Tables [vessel] and [entry] of a scene beside the file, with other entries as comments. Empty if
/// the surface does not load.
std::string ProposeScene(const MeshCheck& check);

}  // namespace torquer::vessel
