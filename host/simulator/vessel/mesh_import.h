// Mesh import: reads surface files in another process. On some damaged files, the library crashes,
// hangs or takes all memory. The program must survive them.
#pragma once

#include <cstdint>
#include <string>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Path of torquer-mesh-reader: libexec/torquer in the installation or build tree (FindInstalled).
/// Throws UserError if it is missing.
std::string MeshReaderPath();

/// Program that reads a surface, and its limits.
struct MeshReader {
  std::string program = MeshReaderPath();
  std::int64_t memory_bytes = 0;  ///< of address space; no limit in builds with sanitizers
  std::int64_t answer_bytes = 0;
  double cpu_s = 0;    ///< of processor time
  double clock_s = 0;  ///< until the answer is complete

  /// Limits for a file of this size: several times the need of any surface, also on a busy machine.
  static MeshReader For(std::size_t file_bytes);
};

/// Bytes of a surface file. Throws UserError naming the file and the remedy if it is missing,
/// unreadable or no ordinary file.
std::string ReadMeshContents(const std::string& path);

/// Triangles of a surface file, unrepaired, multiplied by mm_per_unit. Vertices are not welded;
/// polygons are triangulated; points and lines are left out. `contents`: the file's bytes. `path`
/// names it in messages; its extension gives the format.
///
/// Throws UserError naming the file and the remedy in these cases. The file is not .stl, .obj or
/// .ply, has no triangles or has a non-finite coordinate (naming the vertex). It is broken, or
/// truncated as far as its format shows. Its reader crashed, did not end or exceeded its limits.
TriangleMesh ImportMesh(const std::string& contents, const std::string& path, double mm_per_unit,
                        const MeshReader& reader);
TriangleMesh ImportMesh(const std::string& contents, const std::string& path, double mm_per_unit);

}  // namespace torquer::vessel
