// Newton step of a chain in O(n): the reduced Hessian factored from tip to sheath.
//
// Each segment is a stage of a linear-quadratic problem. Its state is the displacement dx of its
// proximal node and the step xi of the segment before it. Its control is its own step. The
// cost-to-go
//   V(dx, xi) = 1/2 dx'P dx + dx'Q xi + 1/2 xi'R xi + p'dx + q'xi
// is passed from stage to stage by eliminating one 2x2 pivot. All pivots are positive definite
// exactly if the reduced Hessian is.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "host/simulator/core/curve_mechanics.h"
#include "host/simulator/core/pair.h"

namespace torquer {

/// Stage of the sweep for a wire that does not twist. The control is the step in the tangent plane.
/// The state is the displacement of the node and the step of the segment before. If the wire rests
/// curved somewhere, the state also has the turn of the segment's untwisted frame. That turn
/// depends on the steps before (CurveQuadraticModel::turns).
struct BendStage {
  static constexpr bool kTwists = false;
};
/// Stage of a wire that twists: control and state also have the segment's spin. The spin is
/// eliminated first, with its own pivot.
struct TwistStage {
  static constexpr bool kTwists = true;
};

template <class Stage>
class RiccatiSweep {
 public:
  using Control = Eigen::Vector2d;

  /// Reserves room for `max_segments`; no heap later.
  explicit RiccatiSweep(int max_segments);

  /// Factors Hessian + damping weight. `weight` times the local EI/(1 mm) (spins: GJ) is added to
  /// every diagonal. Returns false if the sum is not positive definite; there is then no step.
  bool Factor(const WireModel& model, const Curve& curve, const CurveQuadraticModel& quadratic,
              double weight);

  /// Factors again, with the result of Factor to the bit. It needs a successful factorization of
  /// the same state with the same weight. Since then only the loads of segments 0 .. `last_changed`
  /// may have changed. Reuses the factorization beyond them.
  bool Refactor(const WireModel& model, const Curve& curve, const CurveQuadraticModel& quadratic,
                double weight, int last_changed);

  /// Computes the step of the last successful Factor or Refactor, one control per segment. Also
  /// gives the displacement of every segment's proximal node, mm, to first order. `spin`: rad,
  /// model.spins() per segment, only with twist. Returns the energy decrease that the quadratic
  /// model predicts, mJ (positive).
  double Step(const WireModel& model, const Curve& curve, const CurveQuadraticModel& quadratic,
              std::vector<Control>& step, std::vector<double>& spin,
              std::vector<Eigen::Vector3d>& displacement_mm) const;

 private:
  /// Role of the turn of a segment's frame about its tangent: irrelevant, dependent on the steps,
  /// or an unknown.
  enum class Spin : std::uint8_t { kNone, kFollows, kFree };

  /// Terms of the previous segment's spin in the cost-to-go.
  struct SpinCost {
    double spin_with_displacement[3] = {0, 0, 0};
    Pair spin_with_previous = {0, 0};
    double spin_stiffness = 0;
    double spin_gradient = 0;
  };
  /// Cost-to-go. Scalars are stored in both lanes.
  struct CostToGo : SpinCost {
    Pair p[6];      ///< P: xx, xy, xz, yy, yz, zz
    Pair q[3];      ///< rows of Q
    Pair r;         ///< diagonal of R
    Pair r_cross;   ///< off-diagonal element of R
    Pair gx[3];     ///< p
    Pair g;         ///< q
    Pair force[3];  ///< sum of the gradients of the loads beyond
    double decrease = 0;
  };
  /// Terms of the spin in the cost of a stage.
  struct SpinStageCost : SpinCost {
    Pair q[3];
    Pair with_spin;  ///< couples xi and the spin before
  };
  /// Cost of a stage before its control is eliminated: terms with the control, and terms of only
  /// the step before.
  struct StageCost : SpinStageCost {
    Pair s;        ///< diagonal of the pivot
    Pair cross;    ///< its off-diagonal element
    Pair c;        ///< gradient
    Pair f[3];     ///< coupling with the displacement, by rows
    Pair m[2];     ///< coupling with the step before, by rows
    Pair r;        ///< step before: diagonal
    Pair r_cross;  ///< step before: off-diagonal element
    Pair g;        ///< step before: gradient
  };
  /// The spin is -(spin_constant + spin_of_displacement' dx + spin_of_control' (own xi)
  /// + spin_of_previous' xi + spin_of_spin zeta).
  struct SpinGain {
    double spin_of_displacement[3];
    Pair spin_of_control;
    Pair spin_of_previous;
    double spin_of_spin;
    double spin_constant;
  };
  struct Nothing {};
  /// The control is -(of_displacement' dx + of_previous xi + of_spin zeta + constant).
  struct Gain : std::conditional_t<Stage::kTwists, SpinGain, Nothing> {
    Pair of_displacement[3];  ///< one component of dx each
    Pair of_previous[2];      ///< one component of xi each
    Pair of_spin;             ///< spin of the segment before, if it matters
    Pair constant;
  };
  // Parts of the sweep's loop, separate for readability; inlined, since calls would cost a fifth of
  // the sweep.
  [[gnu::always_inline]] static inline void Assemble(const WireModel& model, const Curve& curve,
                                                     const CurveQuadraticModel& quadratic,
                                                     double weight, int i, Pair length,
                                                     const Pair (&t)[3], CostToGo& v, StageCost& w);
  /// Minimizes over the segment's spin; false if there is no minimum. Only for a TwistStage.
  static bool EliminateSpin(const TwistTerms& twist, double weight, Pair length, const Pair (&t)[3],
                            CostToGo& v, StageCost& w, Gain& gain);
  /// Substitutes the segment's turn, which depends on the steps.
  [[gnu::always_inline]] static inline void SubstituteSpin(const TurnTerms& turn, Pair length,
                                                           const Pair (&t)[3], const CostToGo& v,
                                                           StageCost& w);
  template <Spin kSpin>
  [[gnu::always_inline]] static inline bool Eliminate(const StageCost& w, Gain& gain);
  template <Spin kSpin>
  [[gnu::always_inline]] static inline void Propagate(const StageCost& w, const Gain& gain,
                                                      CostToGo& v);
  /// Sweeps from `first` towards the sheath; `cost` is that of the segments beyond `first`.
  bool Sweep(const WireModel& model, const Curve& curve, const CurveQuadraticModel& quadratic,
             double weight, int first, const CostToGo& cost);
  template <Spin kSpin>
  bool SweepWith(const WireModel& model, const Curve& curve, const CurveQuadraticModel& quadratic,
                 double weight, int first, CostToGo cost);
  template <Spin kSpin>
  void StepWith(const WireModel& model, const Curve& curve, const CurveQuadraticModel& quadratic,
                std::vector<Control>& step, std::vector<double>& spin,
                std::vector<Eigen::Vector3d>& displacement_mm) const;

  static constexpr int kSpacing = 16;  ///< segments from one checkpoint to the next
  std::vector<Gain> gains_;
  std::vector<CostToGo> checkpoints_;  ///< entry k: cost of all segments from k kSpacing on
  double predicted_decrease_ = 0;
};

extern template class RiccatiSweep<BendStage>;
extern template class RiccatiSweep<TwistStage>;

}  // namespace torquer
