// Blood flow in the centerline network: one dimension, Poiseuille's resistance, and a pulse.
//
//   flow(t) = what the outlets' pressures exchange            steady
//           + what the heart drives in at the inlet           times the pulse
//           + what the heart's muscle presses back            times the ejection
//
// Neither the blood's inertia nor the give of the network's own walls is in it, so a wave has no
// speed. With Windkessels, stenoses or obstructing devices the flow is advanced in short implicit
// steps; without them the three parts are solved once.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "host/simulator/effects/blood/flow_graph.h"
#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// The factor on what the heart drives, over its cycle: 1 - depth + depth * ejection, which is
/// sin^2 in the first 35 % of the cycle and has the mean 1. Never negative.
struct Pulse {
  double per_minute = 0;  ///< 0: steady
  double depth = 0;       ///< 0 .. 1: part of the flow that comes in the ejection alone
  double At(double time_s) const;
  /// The ejection, 0 .. 1; steady: its mean over a cycle.
  double Ejection(double time_s) const;
};

/// A loss beyond Poiseuille's where the lumen widens behind a throat, proportional to the square of
/// the flow.
struct StenosisLoss {
  int edge = 0;
  double loss_mmHg_s2_mL2 = 0;
};

/// What obstructs the flow: the rod of all instruments, in the middle of the lumen.
struct Obstruction {
  const WireModel* wire = nullptr;  ///< null: nothing does
  const vessel::MovingField* moving = nullptr;
};

class Flow final : public Effect, public Evolution {
 public:
  /// ends: all free ends but the inlet, and the inlet too where its mean pressure is given (then
  /// inlet_mL_s is not looked at). viscosity_Pa_s > 0. What `obstruction` names must outlive this.
  Flow(std::unique_ptr<const FlowGraph> graph, double viscosity_Pa_s, int inlet, double inlet_mL_s,
       const std::vector<FlowEnd>& ends, const Pulse& pulse,
       std::vector<StenosisLoss> stenoses = {}, const Obstruction& obstruction = {});

  Evolution* evolution() override { return this; }
  void Advance(const TickView& tick) override;
  void Restart() override;
  void CopyFrom(const Effect& twin) override;

  /// Carries Windkessels and stenoses on to a time.
  void AdvanceTo(double time_s);
  /// The devices lie like this from now on.
  void Obstruct(const WireState& state, const PointSet& points);

  const FlowGraph& graph() const { return *graph_; }
  /// The steady network: as it answers to more inflow.
  const FlowSolution& solution() const { return *steady_; }
  /// Grows with each change of solution().
  int version() const { return version_; }
  /// The mean over a cycle; of stenoses, at the mean flow.
  const FlowSolution::Flows& mean() const { return mean_; }
  const Pulse& pulse() const { return pulse_; }
  int inlet() const { return inlet_; }
  /// Every edge's flow, mL/s, at a time: any, but with Windkessels, stenoses or an obstruction one
  /// of the last advance.
  void EdgesAt(double time_s, std::vector<double>& edge_mL_s) const;
  /// Pressures and flows of the last step; where nothing is stepped, of the mean.
  const FlowSolution::Flows& now() const { return now_; }

 private:
  struct Moment {
    double time_s = 0;
    std::vector<double> edge_mL_s;
  };

  std::vector<double> Resistances(const std::vector<double>& stenosis_flow_mL_s) const;
  std::vector<double> Inflow(double inlet_mL_s) const;
  void SolveMean();
  void MakeStep();
  void Step();

  std::unique_ptr<const FlowGraph> graph_;
  const Pulse pulse_;
  const int inlet_;
  const std::vector<StenosisLoss> stenoses_;
  const Obstruction obstruction_;
  std::vector<FlowEnd> outlets_;
  std::optional<double> inlet_mmHg_;
  double inlet_mL_s_;               // the mean
  const double mmHg_s_per_mL_mm3_;  // Poiseuille, for an integral of 1/r^4
  bool has_windkessel_ = false;
  bool stepped_ = false;
  std::vector<double> poiseuille_;  // of each edge, mmHg s/mL
  std::vector<double> obstructed_;  // what devices add to that

  std::unique_ptr<FlowSolution> steady_;
  int version_ = 0;
  FlowSolution::Flows mean_, exchange_, driven_, muscle_;

  // Of the steps.
  std::unique_ptr<FlowSolution> step_;
  std::vector<double> step_losses_mL_s_;  // flow through each stenosis that step_ is made for
  std::vector<double> stored_mmHg_;       // at each Windkessel's compliance
  FlowSolution::Flows now_;
  double time_s_ = 0;
  std::vector<Moment> moments_;  // of the last advance
  std::size_t moment_count_ = 0;
  double obstruction_age_s_ = 0;
};

/// Poiseuille: 8 mu / pi times the integral of 1/r^4.
double PoiseuilleMmHgSPerML(double viscosity_Pa_s, double inverse_fourth_power_1_mm3);

/// What takes the place of 1/r^4 in Poiseuille's law where a cylinder of radius `core_mm` lies in
/// the middle of a tube of radius `tube_mm` (more than core_mm): the closed form for an annulus.
double AnnulusInverseFourthPower(double tube_mm, double core_mm);

/// The loss behind a throat, Kt rho/2 (A/throat - 1)^2 (Q/A)^2 with Kt = 1.52: Young and Tsai,
/// J Biomech 1973;6:395-410. Areas in mm^2, result in mmHg for (mL/s)^2.
double StenosisLossMmHg(double area_mm2, double throat_mm2);

EffectKind FlowKind();

}  // namespace torquer::effects
