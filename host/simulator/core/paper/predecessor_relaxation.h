// Predecessor of the paper's model (Konings et al. 2003, Alderliesten et al. 2004), a baseline.
// Baier et al. 2016 describe it in sections 3.1, 4.1 and 4.5.
//
// Its bending energy is g2. Its update is (16), whose denominator may vanish or turn negative,
// without the bound (18). The wire is fed at its proximal end, in steps below lambda/10, with a
// full cycle after each.
#pragma once

#include <vector>

#include "host/simulator/core/paper/physical_relaxation.h"
#include "host/simulator/core/relaxation.h"

namespace torquer {

struct PredecessorSettings {
  double feed_segments =
      0.0999;  ///< feed of one step in units of lambda; the paper: "smaller than lambda/10"
  double max_turn_rad = 0.02;  ///< largest rotation of one step
  double tolerance = 1e-3;     ///< residual at which a tick counts as converged
};

/// Predecessor's method for a lone wire. One unit of work is a cycle, or a step of the feed or of
/// the rotation with its cycle. A tick without feed or rotation does one cycle. The method may
/// diverge. The state then stays finite with exact lengths, but its residual shows that it is not
/// in equilibrium.
class PredecessorRelaxation final : public Relaxation {
 public:
  /// `model.law()` must be kG2 and `wall.points_per_segment` 1. Keeps references to the three.
  PredecessorRelaxation(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                        const PredecessorSettings& settings);

  void Restart(WireState& state) override;
  void CopyFrom(const Relaxation& twin, const WireState& state) override;
  const QuadraticModel& Current() const override { return current_; }

 private:
  bool Arrived(const InstrumentPoses& goal, const WireState& state) const override;
  void Begin(WireState& state) override;
  bool MayMove() const override { return true; }
  int Move(const InstrumentPoses& goal, WireState& state) override;
  bool AtRest(WireState& state) override;
  void Relax(WireState& state, TickReport& report) override;
  void End(const WireState& state, bool settled, TickReport& report) override;
  void Cycle(WireState& state);

  const WireModel& model_;
  const PredecessorSettings settings_;
  const std::vector<EnergyTerm*> no_terms_;
  WireMechanics mechanics_;
  PhysicalRelaxation physical_;
  bool cycled_ = false;     // a cycle was done in this tick
  bool up_to_date_ = true;  // current_ belongs to the state
  std::int64_t updates_before_ = 0;
  QuadraticModel current_;
};

}  // namespace torquer
