// Equilibrium by Newton's method on the product of spheres, anytime.
//
// A tick reads: feed or rotate a little -> expand -> factor -> step -> accept, until the hand's
// target is reached and the residual is within the tolerance, or the budget is spent. The method
// and its figures are derived in core/README.md.
#pragma once

#include <memory>
#include <vector>

#include "host/simulator/core/newton/riccati_sweep.h"
#include "host/simulator/core/relaxation.h"

namespace torquer {

struct NewtonSettings {
  /// Out-of-balance moment over EI/(1 mm) at which a tick ends converged. 1e-2 .. 1e-9; below
  /// about 1e-10 rounding decides.
  double tolerance = 1e-6;
  /// Longest feed, mm, before the wire is relaxed again; longer commands are split. At most half
  /// a segment is used whatever stands here.
  double max_feed_mm = 0.5;
  /// Largest rotation, rad, before the wire is relaxed again.
  double max_turn_rad = 0.2;
  /// Largest turn of one segment in one step, rad; longer steps are shortened as a whole.
  double max_step_rad = 0.5;
  /// Iterations after each part of a split command; the last part is relaxed to the tolerance.
  int iterations_between_parts = 3;
  /// Iterations after which a tick ends unconverged even if the budget would allow more.
  int max_iterations = 1000;
};

/// `Stage`: whether the wire twists; it must be that of the model.
template <class Stage>
class NewtonMethod final : public Relaxation {
 public:
  NewtonMethod(const WireModel& model, const ClearanceField& field, const WallModel& wall,
               const NewtonSettings& settings, const std::vector<EnergyTerm*>& terms);

  TickReport Tick(const HandTarget& target, WorkBudget& budget, WireState& state) override;
  void Restart(WireState& state) override;
  const Expansion& Current() const override { return current_; }
  /// To be called after the wire's model changed: it is relaxed anew by the next Tick.
  void ModelChanged() { model_changed_ = true; }

 private:
  void RememberPressed();
  void Feed(double feed_mm, WireState& state);
  void Rotate(double angle_rad, WireState& state);
  /// Turns the wire by `ratio` times drift_; false, and not at all, where that is too far.
  bool Drift(double ratio, WireState& state);
  bool MoveTowards(const HandTarget& target, WireState& state, TickReport& report);
  bool Iterate(WireState& state, TickReport& report);
  double SolveModel(const WireState& state);
  /// Which near points press after step_; the most distal segment where that is new, or -1.
  int FindActive(const WireState& state);
  void Accept(WireState& state);
  void Retract(const WireState& from, double scale, WireState& to) const;
  /// Whether a state in balance is a minimum: pushed head-on a straight wire is in balance too.
  bool Stable(const WireState& state);
  void PushOff(WireState& state);

  const WireModel& model_;
  const ClearanceField& field_;
  const NewtonSettings settings_;
  const std::vector<EnergyTerm*>& terms_;
  WireMechanics mechanics_;
  RiccatiSweep<Stage> sweep_;
  Expansion current_;
  Expansion trial_expansion_;
  WireState trial_;
  std::vector<Eigen::Vector2d> step_;
  std::vector<double> spin_step_;  ///< the same about the tangents, for a wire that twists
  std::vector<Eigen::Vector3d> displacement_mm_;
  std::vector<std::uint8_t> active_;    ///< near points that feel the wall in the model
  std::vector<std::uint8_t> pressed_;   ///< before the last move; by PointSet::FromTip
  double travel_mm_ = 0;                ///< of the vessel, in current_
  std::vector<Eigen::Vector3d> fed_;    ///< tangents right after the last feed
  std::vector<Eigen::Vector3d> drift_;  ///< how they turned since, rad; the most distal first
  double fed_mm_ = 0;                   ///< the last feed; 0 if none to go by
  bool predicted_ = false;              ///< the last feed went on with the drift
  bool model_changed_ = false;
  bool moved_ = false;       ///< fed or turned, and no step accepted since
  double damping_ = 0;       ///< proximal weight over residual that last worked
  double feed_damping_ = 0;  ///< the same of the first iteration after a move, for the next move
  double proximal_ = 0;      ///< the weight in use
  bool stable_ = false;  ///< the Hessian was positive definite where the state is, or a step before
};

extern template class NewtonMethod<BendStage>;
extern template class NewtonMethod<TwistStage>;

/// The method for a wire that does not twist.
using NewtonRelaxation = NewtonMethod<BendStage>;

/// The method for `model`, with or without twist.
std::unique_ptr<Relaxation> MakeNewtonRelaxation(const WireModel& model,
                                                 const ClearanceField& field, const WallModel& wall,
                                                 const NewtonSettings& settings,
                                                 const std::vector<EnergyTerm*>& terms);

}  // namespace torquer
