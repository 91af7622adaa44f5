// Newton's method for the equilibrium on the product of spheres; it can stop at any time.
//
// Relaxing repeats: solve the model, step, accept or refuse. Sections 6 to 8 of core/README.md
// derive the method and its constants. The file relaxation.cpp decides when it moves and when it
// relaxes.
#pragma once

#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "host/simulator/core/discretization_error.h"
#include "host/simulator/core/newton/front_sweep.h"
#include "host/simulator/core/newton/newton_memory.h"
#include "host/simulator/core/newton/riccati_sweep.h"
#include "host/simulator/core/newton/step_solver.h"
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
  /// a segment, or to 0.25 mm if that is more.
  double max_feed_mm = 0.25;
  /// Largest rotation, rad, before the wire is relaxed again.
  double max_turn_rad = 0.2;
  /// Largest turn of one segment in one step, rad; longer steps are shortened as a whole.
  double max_step_rad = 0.5;
  /// Residual at which the next part of a split command may follow. Without a step 0.3 of it holds,
  /// after a damped one 0.1. The last part meets the tolerance. More changes the path of friction.
  double part_tolerance = 1e-4;
  /// Number of iterations after which the next part follows in any case. So a jammed wire that
  /// hardly comes to rest still follows its hands.
  int most_iterations_a_part = 12;
};

/// `Sweep`: see StepSolver. A unit of work is a part of the motion, or an attempt at a step.
template <class Sweep>
class NewtonMethod final : public Relaxation {
 public:
  /// A lone wire. Keeps references to all but the settings.
  NewtonMethod(const WireModel& wire, const ClearanceField& field, const WallModel& wall,
               const NewtonSettings& settings, const std::vector<EnergyTerm*>& terms);
  /// A stack.
  NewtonMethod(const InstrumentStack& stack, const ClearanceField& field, const WallModel& wall,
               const NewtonSettings& settings, const std::vector<EnergyTerm*>& terms);

  void Restart(WireState& state) override;
  void CopyFrom(const Relaxation& twin, const WireState& state) override;
  const QuadraticModel& Current() const override { return memory_.current; }
  std::uint64_t Hash(std::uint64_t seed) const override;
  double SolverErrorMm(const WireState& state) override;
  double DiscretizationErrorMm(const WireState& state) override;

 private:
  static constexpr bool kFront = std::is_same_v<Sweep, FrontSweep>;
  static constexpr bool kTwists = std::is_same_v<Sweep, RiccatiSweep<TwistStage>>;

  // Common part of both public constructors.
  template <class Wires>
  NewtonMethod(std::in_place_t both, const Wires& wires, const ClearanceField& field,
               const WallModel& wall, const NewtonSettings& settings,
               const std::vector<EnergyTerm*>& terms);

  bool Arrived(const InstrumentPoses& goal, const WireState& state) const override;
  void Begin(WireState& state) override;
  bool MayMove() const override;
  int Move(const InstrumentPoses& goal, WireState& state) override;
  bool AtRest(WireState& state) override;
  void Relax(WireState& state, TickReport& report) override;
  void End(const WireState& state, bool settled, TickReport& report) override;

  // For the terms, every part of a motion is one relaxation: Begin .. End.
  void FollowVessel(WireState& state);
  void BeginPart(const WireState& state);
  void EndPart(const WireState& state);
  void FindPressed(const WireState& state);
  AttemptRecord Attempt(const WireState& state, TickReport& report);
  void Accept(const AttemptRecord& record, WireState& state, TickReport& report);
  void GiveUp(const WireState& state);
  bool Stable(const WireState& state);
  void Pair(const WireState& state);
  bool Paired(const WireState& state);
  void PairAfterLongMoves(const WireState& state);
  void PushOff(WireState& state);
  void BuildModel(const WireState& state);
  void BringUpToDate(const WireState& state);
  void RestoreTrueLoads(const WireState& state);

  const WireModel& model_;
  const ClearanceField& field_;
  const NewtonSettings settings_;
  const std::vector<EnergyTerm*>& terms_;
  WireMechanics mechanics_;
  StepSolver<Sweep> solver_;
  NewtonMemory memory_;
  // Work space, without data from one call to the next.
  QuadraticModel trial_quadratic_;
  WireState trial_;
  DiscretizationDefect defect_;
  HandForces balance_;  // of each instrument; for terms that act between instruments
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
std::unique_ptr<Relaxation> MakeNewtonRelaxation(const InstrumentStack& stack,
                                                 const ClearanceField& field, const WallModel& wall,
                                                 const NewtonSettings& settings,
                                                 const std::vector<EnergyTerm*>& terms);

}  // namespace torquer
