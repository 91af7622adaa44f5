// Two instruments, one rod: moves both and relaxes.
#pragma once

#include "host/simulator/core/coaxial/coaxial_pair.h"
#include "host/simulator/core/newton/newton_relaxation.h"

namespace torquer {

/// Newton's method for a wire in a catheter. The state is the rod's: insertion_mm is how far it
/// reaches, rotation_rad the wire's.
class CoaxialRelaxation final : public Relaxation {
 public:
  /// `pair` outlives this, and its places are moved by it; they begin with `wire` and `catheter`.
  CoaxialRelaxation(CoaxialPair& pair, const InstrumentPlace& wire, const InstrumentPlace& catheter,
                    const ClearanceField& field, const WallModel& wall,
                    const NewtonSettings& settings, const std::vector<EnergyTerm*>& terms);

  TickReport Tick(const HandTarget& target, WorkBudget& budget, WireState& state) override;
  /// The state is to reach as far as the farther of the two at their start.
  void Restart(WireState& state) override;
  const Expansion& Current() const override { return rod_.Current(); }

 private:
  HandTarget Bounded(const HandTarget& target) const;
  bool Arrived(const HandTarget& target) const;
  void MoveTowards(const HandTarget& target, const WireState& state);

  CoaxialPair& pair_;
  const InstrumentPlace wire_start_;
  const InstrumentPlace catheter_start_;
  const NewtonSettings settings_;
  const std::vector<EnergyTerm*>& terms_;
  NewtonRelaxation rod_;
};

}  // namespace torquer
