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

#include "host/simulator/core/pair.h"
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

  /// The same as Factor, to the bit, after one that succeeded on the same state with the same
  /// weight, where since then nothing but the loads of segments 0 .. `last_changed` changed. Takes
  /// over what lies beyond.
  bool Refactor(const WireModel& model, const WireState& state, const Expansion& expansion,
                double proximal, int last_changed);

  /// The step of the last successful Factor or Refactor, one control a segment, and the
  /// displacement of every segment's proximal node by it, mm, to first order. Returns the decrease
  /// of energy that the quadratic model predicts for it, mJ (positive).
  double Step(const WireModel& model, const WireState& state, const Expansion& expansion,
              std::vector<Control>& step, std::vector<Eigen::Vector3d>& displacement_mm) const;

 private:
  /// The cost-to-go. Single numbers stand in both lanes.
  struct CostToGo {
    Pair p[6];      ///< P: xx, xy, xz, yy, yz, zz
    Pair q[3];      ///< rows of Q
    Pair r;         ///< diagonal of R
    Pair r_cross;   ///< R's other element
    Pair gx[3];     ///< p
    Pair g;         ///< q
    Pair force[3];  ///< sum of the gradients of the loads beyond
    double decrease = 0;
  };
  /// The control is -(of_displacement' dx + of_previous xi + constant).
  struct Gain {
    Pair of_displacement[3];  ///< a component of dx each
    Pair of_previous[2];      ///< a component of xi each
    Pair constant;
  };
  /// From `first` towards the sheath; `cost` is that of the segments beyond it.
  bool Sweep(const WireModel& model, const WireState& state, const Expansion& expansion,
             double proximal, int first, CostToGo cost);

  static constexpr int kSpacing = 16;  ///< segments from one checkpoint to the next
  std::vector<Gain> gains_;
  std::vector<CostToGo> checkpoints_;  ///< k: of all segments from k kSpacing on
  double predicted_decrease_ = 0;
};

}  // namespace torquer
