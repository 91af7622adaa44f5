// Newton step of a chain in O(n): the reduced Hessian factored from tip to sheath.
//
// Each segment is a stage of a linear-quadratic problem: its state is the displacement dx of its
// proximal node and the step xi of the segment before it, its control its own step. Cost-to-go
//   V(dx, xi) = 1/2 dx'P dx + dx'Q xi + 1/2 xi'R xi + p'dx + q'xi
// goes from stage to stage by eliminating one 2x2 pivot. All pivots positive definite is the same
// as a positive definite reduced Hessian.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "host/simulator/core/pair.h"
#include "host/simulator/core/wire_mechanics.h"

namespace torquer {

/// What the stage of the sweep consists of: the control is the step in the tangent plane, the state
/// the displacement of the node and the step of the segment before. Where the wire rests curved
/// somewhere, the state has the turn of the segment's untwisted frame as well, which follows from
/// the steps before (Expansion::turns).
struct BendStage {
  static constexpr bool kTwists = false;
};
/// A stage of a wire that twists: control and state have the segment's spin as well. It is
/// eliminated first, with its own pivot.
struct TwistStage {
  static constexpr bool kTwists = true;
};

template <class Stage>
class RiccatiSweep {
 public:
  using Control = Eigen::Vector2d;

  /// Room for `max_segments`; no heap later.
  explicit RiccatiSweep(int max_segments);

  /// Factors Hessian + damping weight. `weight` times the local EI/(1 mm) (spins: GJ) is added
  /// to every diagonal. False, and no step, when that is not positive definite.
  bool Factor(const WireModel& model, const WireState& state, const Expansion& expansion,
              double weight);

  /// The same as Factor, to the bit, after one that succeeded on the same state with the same
  /// weight, where since then nothing but the loads of segments 0 .. `last_changed` changed. Takes
  /// over what lies beyond.
  bool Refactor(const WireModel& model, const WireState& state, const Expansion& expansion,
                double weight, int last_changed);

  /// The step of the last successful Factor or Refactor, one control a segment, and the
  /// displacement of every segment's proximal node by it, mm, to first order; `spin`, rad, only of
  /// what twists, model.spins() a segment. Returns the decrease of energy that the quadratic model
  /// predicts for it, mJ (positive).
  double Step(const WireModel& model, const WireState& state, const Expansion& expansion,
              std::vector<Control>& step, std::vector<double>& spin,
              std::vector<Eigen::Vector3d>& displacement_mm) const;

 private:
  /// What the turn of a segment's frame about its tangent is: nothing that matters, a consequence
  /// of the steps, or an unknown.
  enum class Spin : std::uint8_t { kNone, kFollows, kFree };

  /// What the spin of the segment before adds to the cost-to-go.
  struct SpinCost {
    double spin_with_displacement[3] = {0, 0, 0};
    Pair spin_with_previous = {0, 0};
    double spin_stiffness = 0;
    double spin_gradient = 0;
  };
  /// The cost-to-go. Single numbers stand in both lanes.
  struct CostToGo : SpinCost {
    Pair p[6];      ///< P: xx, xy, xz, yy, yz, zz
    Pair q[3];      ///< rows of Q
    Pair r;         ///< diagonal of R
    Pair r_cross;   ///< R's other element
    Pair gx[3];     ///< p
    Pair g;         ///< q
    Pair force[3];  ///< sum of the gradients of the loads beyond
    double decrease = 0;
  };
  /// What the spin adds to the cost of a stage.
  struct SpinStageCost : SpinCost {
    Pair q[3];
    Pair with_spin;  ///< couples xi and the spin before
  };
  /// The cost of a stage before its control is eliminated: what the control takes part in, and what
  /// the step before costs by itself.
  struct StageCost : SpinStageCost {
    Pair s;        ///< diagonal of the pivot
    Pair cross;    ///< its other element
    Pair c;        ///< gradient
    Pair f[3];     ///< with the displacement, by rows
    Pair m[2];     ///< with the step before, by rows
    Pair r;        ///< of the step before: diagonal
    Pair r_cross;  ///< and other element
    Pair g;        ///< and gradient
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
    Pair of_displacement[3];  ///< a component of dx each
    Pair of_previous[2];      ///< a component of xi each
    Pair of_spin;             ///< of the segment before, where that counts
    Pair constant;
  };
  // Parts of the sweep's loop, apart to be read: a call for each would cost a fifth of the sweep.
  [[gnu::always_inline]] static inline void Assemble(const WireModel& model, const WireState& state,
                                                     const Expansion& expansion, double weight,
                                                     int i, Pair length, const Pair (&t)[3],
                                                     CostToGo& v, StageCost& w);
  /// Minimizes over the segment's spin; false where that has no minimum. Only of a TwistStage.
  static bool EliminateSpin(const TwistTerms& twist, double weight, Pair length, const Pair (&t)[3],
                            CostToGo& v, StageCost& w, Gain& gain);
  /// Puts in the segment's turn as it follows from the steps.
  [[gnu::always_inline]] static inline void SubstituteSpin(const TurnTerms& turn, Pair length,
                                                           const Pair (&t)[3], const CostToGo& v,
                                                           StageCost& w);
  template <Spin kSpin>
  [[gnu::always_inline]] static inline bool Eliminate(const StageCost& w, Gain& gain);
  template <Spin kSpin>
  [[gnu::always_inline]] static inline void Propagate(const StageCost& w, const Gain& gain,
                                                      CostToGo& v);
  /// From `first` towards the sheath; `cost` is that of the segments beyond it.
  bool Sweep(const WireModel& model, const WireState& state, const Expansion& expansion,
             double weight, int first, const CostToGo& cost);
  template <Spin kSpin>
  bool SweepWith(const WireModel& model, const WireState& state, const Expansion& expansion,
                 double weight, int first, CostToGo cost);
  template <Spin kSpin>
  void StepWith(const WireModel& model, const WireState& state, const Expansion& expansion,
                std::vector<Control>& step, std::vector<double>& spin,
                std::vector<Eigen::Vector3d>& displacement_mm) const;

  static constexpr int kSpacing = 16;  ///< segments from one checkpoint to the next
  std::vector<Gain> gains_;
  std::vector<CostToGo> checkpoints_;  ///< k: of all segments from k kSpacing on
  double predicted_decrease_ = 0;
};

extern template class RiccatiSweep<BendStage>;
extern template class RiccatiSweep<TwistStage>;

}  // namespace torquer
