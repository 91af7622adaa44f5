// Shadow wire: a wire with another value of a parameter, which lies close beside the simulated one.
#pragma once

#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/newton/part_follower.h"
#include "host/simulator/core/stack/combined_rods.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// It has its own rod, wall and energy terms, so its own anchors of friction. It is never relaxed:
/// its states are those of the simulated wire plus a given step. Only for one curve. No heap after
/// construction.
class ShadowWire {
 public:
  /// Keeps references to all but `terms`.
  ShadowWire(const InstrumentStack& stack, const ClearanceField& field, const WallModel& wall,
             std::vector<EnergyTerm*> terms);
  ShadowWire(const ShadowWire&) = delete;
  ShadowWire& operator=(const ShadowWire&) = delete;

  /// Functions of PartFollower.
  void Restart(const WireState& state);
  void BeginPart();
  void MovePart(const PartMotion& motion, const WireState& state);
  void EndPart();
  /// Lays the shadow at `state` plus `scale` times `step` in the planes `frames`, and finds its
  /// gradient there.
  void Place(const WireState& state, const std::vector<Frame>& frames, const CurveStep& step,
             double scale);
  /// Takes over the state of a shadow of the same scene. The memory of terms is not copied here.
  void CopyFrom(const ShadowWire& twin);

  const CombinedRods& rods() const { return rods_; }
  const WireState& state() const { return state_; }
  /// Quadratic model without Hessian at the state.
  const QuadraticModel& model() const { return model_; }
  /// True if a term depends on the way to a state.
  bool remembers() const;

 private:
  CombinedRods rods_;
  std::vector<EnergyTerm*> terms_;
  WireMechanics mechanics_;
  WireState state_;
  QuadraticModel model_;
};

}  // namespace torquer
