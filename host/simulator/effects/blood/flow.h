// Blood flow in the centerline network: one dimension, Poiseuille's resistance, and a pulse.
//
// The flow is solved once; in time it is scaled as a whole by the pulse (quasi-steady: neither the
// blood's inertia nor the wall's give is in it, so a wave has no speed). Devices do not obstruct.
#pragma once

#include <memory>
#include <vector>

#include "host/simulator/effects/blood/flow_graph.h"
#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// The factor on the mean flow over a heart's cycle: 1 - depth + depth * ejection, which is
/// sin^2 in the first 35 % of the cycle and has the mean 1. Never negative.
struct Pulse {
  double per_minute = 0;  ///< 0: steady
  double depth = 0;       ///< 0 .. 1: part of the flow that comes in the ejection alone
  double At(double time_s) const;
};

class Flow final : public Effect, public Evolution {
 public:
  /// ends: all free ends but the inlet, and the inlet too where its pressure is given (then
  /// inlet_mL_s is 0). viscosity_Pa_s > 0.
  Flow(std::unique_ptr<const FlowGraph> graph, double viscosity_Pa_s, int inlet, double inlet_mL_s,
       std::vector<FlowEnd> ends, const Pulse& pulse);

  Evolution* evolution() override { return this; }
  void Advance(const TickView& tick) override { time_s_ = tick.time_s; }
  void Restart() override { time_s_ = 0; }

  const FlowGraph& graph() const { return *graph_; }
  const FlowSolution& solution() const { return solution_; }
  /// The mean over a cycle.
  const FlowSolution::Flows& mean() const { return mean_; }
  const Pulse& pulse() const { return pulse_; }
  int inlet() const { return inlet_; }
  /// Of the last tick.
  double time_s() const { return time_s_; }
  double edge_mL_s(int edge) const {
    return pulse_.At(time_s_) * mean_.edge_mL_s[static_cast<std::size_t>(edge)];
  }

 private:
  std::unique_ptr<const FlowGraph> graph_;
  FlowSolution solution_;
  FlowSolution::Flows mean_;
  Pulse pulse_;
  int inlet_;
  double time_s_ = 0;
};

/// Poiseuille: 8 mu / pi times the integral of 1/r^4.
double PoiseuilleMmHgSPerML(double viscosity_Pa_s, double inverse_fourth_power_1_mm3);

EffectKind FlowKind();

}  // namespace torquer::effects
