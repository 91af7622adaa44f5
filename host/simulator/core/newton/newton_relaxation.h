// Newton's method for the equilibrium on the product of spheres; it can stop at any time.
//
// Relaxing repeats: solve the model, step, accept or refuse. Sections 6 to 8 of core/README.md
// derive the method and its constants. relaxation.cpp decides when it moves and when it relaxes.
#pragma once

#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "host/simulator/core/discretization_error.h"
#include "host/simulator/core/newton/active_set.h"
#include "host/simulator/core/newton/damping.h"
#include "host/simulator/core/newton/feed_prediction.h"
#include "host/simulator/core/newton/front_sweep.h"
#include "host/simulator/core/newton/riccati_sweep.h"
#include "host/simulator/core/relaxation.h"
#include "host/simulator/core/stack/hand_forces.h"

namespace torquer {

struct NewtonSettings {
  /// Out-of-balance moment over EI/(1 mm) at which a tick ends converged. 1e-2 .. 1e-9; below
  /// about 1e-10 rounding decides.
  double tolerance = 1e-6;
  /// Largest SolverErrorMm at which a tick ends converged, in addition; 0 for no limit.
  double tolerance_mm = 0;
  /// Longest feed, mm, before the wire is relaxed again; longer commands are split. Limited to half
  /// a segment in any case.
  double max_feed_mm = 0.25;
  /// Largest rotation, rad, before the wire is relaxed again.
  double max_turn_rad = 0.2;
  /// Largest turn of one segment in one step, rad; longer steps are shortened as a whole.
  double max_step_rad = 0.5;
  /// Residual at which the next part of a split command may follow. The last part is relaxed to the
  /// tolerance. Larger values let friction lead the wire along another path.
  double part_tolerance = 1e-4;
  /// Number of iterations after which the next part follows in any case. So a jammed wire that
  /// hardly comes to rest still follows its hands.
  int most_iterations_a_part = 12;
};

/// `Sweep`: solver of the model. RiccatiSweep serves a lone wire and instruments on one curve that
/// do not twist; FrontSweep serves all others. A unit of work is a part of the motion, or an
/// attempt at a step.
template <class Sweep>
class NewtonMethod final : public Relaxation {
 public:
  /// A lone wire. Keeps references to all but the settings.
  NewtonMethod(const WireModel& wire, const ClearanceField& field, const WallModel& wall,
               const NewtonSettings& settings, const std::vector<EnergyTerm*>& terms);
  /// A stack, which it moves.
  NewtonMethod(InstrumentStack& stack, const ClearanceField& field, const WallModel& wall,
               const NewtonSettings& settings, const std::vector<EnergyTerm*>& terms);

  void Restart(WireState& state) override;
  void CopyFrom(const Relaxation& twin, const WireState& state) override;
  const Expansion& Current() const override { return current_; }
  std::uint64_t Hash(std::uint64_t seed) const override;
  double SolverErrorMm(const WireState& state) override;
  double DiscretizationErrorMm(const WireState& state) override;

 private:
  // Minimum of the energy model.
  struct Solution {
    double expected_mJ = -1;  // decrease; negative if the model has no minimum or none was found
    int rounds = 0;
  };

  static constexpr bool kFront = std::is_same_v<Sweep, FrontSweep>;
  static constexpr bool kTwists = std::is_same_v<Sweep, RiccatiSweep<TwistStage>>;

  static Sweep MakeSweep(int max_segments, const WireModel* second) {
    if constexpr (kFront) {
      return FrontSweep(max_segments, second);
    } else {
      static_cast<void>(second);
      return Sweep(max_segments);
    }
  }

  // Common part of both public constructors.
  template <class Wires>
  NewtonMethod(std::in_place_t both, Wires& wires, const ClearanceField& field,
               const WallModel& wall, const NewtonSettings& settings,
               const std::vector<EnergyTerm*>& terms);

  bool Arrived(const InstrumentPlaces& goal, const WireState& state) const override;
  void Begin(WireState& state) override;
  bool MayMove() const override;
  int Move(const InstrumentPlaces& goal, WireState& state) override;
  bool AtRest(WireState& state) override;
  void Relax(WireState& state, TickReport& report) override;
  void End(const WireState& state, bool settled, TickReport& report) override;

  // For the terms, every part of a motion is one relaxation: Begin .. End.
  void BeginPart(const WireState& state);
  void EndPart();
  void FindPressed(const WireState& state);
  void MoveTo(const InstrumentPlaces& next, WireState& state);
  void MoveBothTo(const InstrumentPlaces& next, WireState& state);
  void MoveSurfaces(const InstrumentPlaces& here, const InstrumentPlaces& next);
  Solution SolveModel(const WireState& state);
  void BeginModel(const WireState& state, bool moved);
  int UpdateModel(const WireState& state);
  void ModelLoads(const WireState& state);
  double EnergyAtRest() const;
  void StepTrial(const WireState& state, double scale);
  double StepScale() const;
  void GiveUp(WireState& state);
  bool Stable(const WireState& state);
  void PushOff(WireState& state);
  void BringUpToDate(const WireState& state);
  void ExpandTrueLoads(const WireState& state);

  const WireModel& model_;
  const ClearanceField& field_;
  const NewtonSettings settings_;
  const std::vector<EnergyTerm*>& terms_;
  const bool two_curves_;
  WireMechanics mechanics_;
  Sweep sweep_;
  ActiveSet active_set_;
  BetweenSet between_set_;
  Damping damping_;
  FeedPrediction prediction_;
  Expansion current_;  // of the state if up_to_date_
  Expansion trial_expansion_;
  WireState trial_;
  std::vector<Eigen::Vector2d> step_;
  std::vector<double> spin_step_;  // same for the spins; model.spins() per segment
  std::vector<Eigen::Vector3d>
      displacement_mm_;                       // of every segment's proximal node due to the step
  std::vector<Eigen::Vector2d> second_push_;  // of the second curve, off an unstable equilibrium
  std::vector<double> second_push_spin_;      // all zeros
  DiscretizationDefect defect_;
  HandForces balance_;    // of each instrument; for terms that act between instruments
  double travel_mm_ = 0;  // travel of the vessel at current_
  int iterations_since_move_ = 0;
  bool up_to_date_ = true;
  bool attempting_ = false;  // an iteration has begun, and none of its attempts was accepted
  bool moved_ = false;       // the wire was moved, and no step accepted since
  bool stalled_ = false;     // no step improves the wire
  bool pushed_ = false;      // pushed off an unstable equilibrium, in this part
  bool part_open_ = false;   // the terms have begun a part that has not ended
  bool part_moved_ = false;  // the wire was moved in this part
  bool stable_ = false;      // the Hessian was positive definite at the state, or one step before
};

extern template class NewtonMethod<RiccatiSweep<BendStage>>;
extern template class NewtonMethod<RiccatiSweep<TwistStage>>;
extern template class NewtonMethod<FrontSweep>;

/// The method for a wire that does not twist.
using NewtonRelaxation = NewtonMethod<RiccatiSweep<BendStage>>;

/// The method for a lone wire or a stack, with or without twist.
std::unique_ptr<Relaxation> MakeNewtonRelaxation(const WireModel& wire, const ClearanceField& field,
                                                 const WallModel& wall,
                                                 const NewtonSettings& settings,
                                                 const std::vector<EnergyTerm*>& terms);
std::unique_ptr<Relaxation> MakeNewtonRelaxation(InstrumentStack& stack,
                                                 const ClearanceField& field, const WallModel& wall,
                                                 const NewtonSettings& settings,
                                                 const std::vector<EnergyTerm*>& terms);

}  // namespace torquer
