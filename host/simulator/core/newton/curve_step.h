// Step of a curve: the unknowns of an iteration.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace torquer {

/// Step of a curve in the tangent planes of its segments, with derived quantities.
struct CurveStep {
  std::vector<Eigen::Vector2d> xi;               ///< by segment, rad
  std::vector<double> spin;                      ///< by segment and spin of the model, rad
  std::vector<Eigen::Vector3d> displacement_mm;  ///< of every segment's proximal node

  /// Reserves room for `segments` segments with `spins` spins each.
  void Reserve(std::size_t segments, std::size_t spins) {
    xi.reserve(segments);
    spin.reserve(segments * spins);
    displacement_mm.reserve(segments);
  }
};

}  // namespace torquer
