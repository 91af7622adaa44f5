// Newton step of a chain in O(n): the reduced Hessian factored from tip to sheath.
//
// Each segment is a stage of a linear-quadratic problem: its state is the displacement dx of its
// proximal node and the step xi of the segment before it, its control its own step. Cost-to-go
//   V(dx, xi) = 1/2 dx'P dx + dx'Q xi + 1/2 xi'R xi + p'dx + q'xi
// goes from stage to stage by eliminating one 2x2 pivot. All pivots positive definite is the same
// as a positive definite reduced Hessian.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/core/wire_mechanics.h"

namespace torquer {

/// What the stage of the sweep consists of. Torsion will add the spin to state and control.
struct BendStage {
  static constexpr int kControl = 2;  ///< step in the tangent plane
  static constexpr int kState = 5;    ///< displacement of the node, step of the segment before
};

template <class Stage>
class RiccatiSweep;

template <>
class RiccatiSweep<BendStage> {
 public:
  using Control = Eigen::Matrix<double, BendStage::kControl, 1>;

  /// Room for `max_segments`; no heap later.
  explicit RiccatiSweep(int max_segments);

  /// Factors Hessian + proximal weight. `proximal` times the local EI/(1 mm) is added to every
  /// diagonal. False, and no step, when that is not positive definite.
  bool Factor(const WireModel& model, const WireState& state, const Expansion& expansion,
              double proximal);

  /// The step of the last successful Factor, one control a segment, and the displacement of every
  /// segment's proximal node by it, mm, to first order. Returns the decrease of energy that the
  /// quadratic model predicts for it, mJ (positive).
  double Step(const WireModel& model, const WireState& state, const Expansion& expansion,
              std::vector<Control>& step, std::vector<Eigen::Vector3d>& displacement_mm) const;

 private:
  struct Gain {
    Eigen::Vector3d of_displacement1;
    Eigen::Vector3d of_displacement2;
    Eigen::Matrix2d of_previous;
    Eigen::Vector2d constant;
  };
  std::vector<Gain> gains_;
  double predicted_decrease_ = 0;
};

}  // namespace torquer
