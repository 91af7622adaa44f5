// The model that the paper starts from (Konings et al. 2003, Alderliesten et al. 2004), as Baier et
// al. 2016 describe it in sections 3.1, 4.1 and 4.5: a baseline.
//
// Bending energy g2; update (16), whose denominator may vanish or turn negative, without the bound
// (18); the wire is fed at its proximal end, in steps below lambda/10, with a full cycle after
// each.
#pragma once

#include <vector>

#include "host/simulator/core/paper/physical_relaxation.h"
#include "host/simulator/core/relaxation.h"

namespace torquer {

struct PredecessorSettings {
  double feed_segments = 0.0999;  ///< of lambda, one step's feed; "smaller than lambda/10"
  double max_turn_rad = 0.02;     ///< largest rotation of one step
  double tolerance = 1e-3;        ///< residual at which a tick counts as converged
};

class PredecessorRelaxation final : public Relaxation {
 public:
  /// `model.law()` must be kG2 and `wall.points_per_segment` 1. Keeps references to the three.
  PredecessorRelaxation(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                        const PredecessorSettings& settings);

  /// One unit of work is a step of the feed or of the rotation with its cycle, or a cycle. A tick
  /// in which nothing is to be fed or turned does one cycle. It may diverge: then the state stays
  /// finite and its lengths exact, but energy and residual say that it is no equilibrium.
  TickReport Tick(const HandTarget& target, WorkBudget& budget, WireState& state) override;
  void Restart(WireState& state) override;
  const Expansion& Current() const override { return current_; }

 private:
  void Step(const HandTarget& target, WireState& state);
  void Cycle(WireState& state);
  double Carried(const HandTarget& target, const WireState& state) const;

  const WireModel& model_;
  const PredecessorSettings settings_;
  const std::vector<EnergyTerm*> no_terms_;
  WireMechanics mechanics_;
  PhysicalRelaxation physical_;
  Expansion current_;
};

}  // namespace torquer
