// Samples of a surface's faces, for estimates over its area.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

struct SampledFace {
  std::size_t face = 0;
  double weight_mm2 = 0;  ///< area that the face stands for
};

/// Sample of `faces`, in their order: all of them, each for its own area, if there are at most
/// `most`. A larger set has `most` places, drawn at random over its area. So no pattern in the
/// order of the faces matters. A large face may come repeatedly, and a face without area never
/// comes then. The same faces give the same sample.
std::vector<SampledFace> SampleFaces(const TriangleMesh& mesh, std::span<const std::int32_t> faces,
                                     std::size_t most);

/// Sample of all faces.
std::vector<SampledFace> SampleFaces(const TriangleMesh& mesh, std::size_t most);

}  // namespace torquer::vessel
