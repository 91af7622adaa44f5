// Surface files, read by another process: the library that knows their formats crashes, hangs or
// takes all memory on some damaged files, and a session is not to end by a file.
#pragma once

#include <cstdint>
#include <string>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Where torquer-mesh-reader is: in the folder `helpers` beside the program, else where it was
/// built.
std::string MeshReaderPath();

/// What reads a surface, and what it may take for it.
struct MeshReader {
  std::string program = MeshReaderPath();
  std::int64_t memory_bytes = 0;  ///< of address space; no limit in builds with sanitizers
  std::int64_t answer_bytes = 0;
  double cpu_s = 0;    ///< of processor time
  double clock_s = 0;  ///< until it has answered

  /// Several times what any surface of so many bytes takes, on a busy machine too.
  static MeshReader For(std::size_t file_bytes);
};

/// The bytes of a surface file. Throws UserError naming the file and the remedy: missing,
/// unreadable or no ordinary file.
std::string ReadMeshContents(const std::string& path);

/// The triangles of a surface file as they stand, times mm_per_unit. Vertices come unwelded,
/// polygons as fans; points and lines are left out. `contents`: the file's bytes; `path` names it
/// in messages, and its ending says the format.
///
/// Throws UserError naming the file and the remedy: not .stl, .obj or .ply, broken or truncated as
/// far as its format tells, without triangles, with a coordinate that is not finite (naming the
/// vertex), or such that its reader crashed, did not end or needed more than it may.
TriangleMesh ImportMesh(const std::string& contents, const std::string& path, double mm_per_unit,
                        const MeshReader& reader);
TriangleMesh ImportMesh(const std::string& contents, const std::string& path, double mm_per_unit);

}  // namespace torquer::vessel
