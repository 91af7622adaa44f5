// What a surface file is and whether it will do, before a scene names it.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/vessel/mesh_repair.h"
#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// A place where an instrument may enter.
struct EntryProposal {
  Eigen::Vector3d point_mm;
  Eigen::Vector3d direction;  ///< unit, along the vessel
  double room_mm = 0;         ///< from the point to the wall
};

struct MeshCheck {
  std::string path;
  /// The file's triangles, in mm by `unit`, with vertices that coincide made one. Empty where the
  /// file cannot be parsed.
  TriangleMesh raw;
  Eigen::Vector3d size;  ///< of the file's box, in its unit
  size_t triangles_read = 0;
  size_t vertices_welded = 0;
  /// By which the surface has the size of a vessel; none where neither does.
  std::optional<MeshUnit> unit;
  repair::EdgeFaults edges;
  int components = 0;  ///< joined over edges of two triangles
  /// Repaired; none where it is refused.
  std::optional<SurfaceMesh> surface;
  std::string refusal;                 ///< what a scene with this surface would say
  std::vector<EntryProposal> entries;  ///< one for each open end; else the widest place
};

/// Looks at the bytes of a surface file; `path` names it in messages, and its ending says the
/// format. Throws no UserError: what is wrong with the file is in the result.
MeshCheck CheckMesh(const std::string& contents, const std::string& path);

/// The result for a person, line by line.
std::string DescribeCheck(const MeshCheck& check);

/// The tables [vessel] and [entry] of a scene beside the file, with other entries as comments.
/// Empty where the surface does not load.
std::string ProposeScene(const MeshCheck& check);

}  // namespace torquer::vessel
