// Surface regions: the faces of a surface, joined over its edges of two faces.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// Faces joined over edges of two faces, sorted by decreasing area for sampling.
struct SurfaceRegion {
  std::vector<int32_t> faces;
  bool is_bounded = false;   ///< has an unbalanced edge
  std::vector<int32_t> rim;  ///< faces at open edges or edges of several faces
};
std::vector<SurfaceRegion> RegionsOf(const TriangleMesh& mesh);

/// Number of faces of a region from which samples represent it.
inline constexpr size_t kRegionSamples = 64;

/// Area of a face, mm^2.
inline double AreaOf(const TriangleMesh& mesh, size_t face) {
  return mesh.DoubleArea(face).norm() / 2;
}

/// A step from the middle of a face to its outer side, much shorter than the face.
Eigen::Vector3d StepOut(const TriangleMesh& mesh, size_t face);

/// The faces of which `keep` is true, or those of which it is false, with their vertices.
TriangleMesh Part(const TriangleMesh& mesh, const std::vector<char>& keep, bool kept);

}  // namespace torquer::vessel
