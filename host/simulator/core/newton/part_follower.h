// Part follower: sees each part of a motion that Newton's method carries out.
#pragma once

#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/newton/curve_step.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Linear equations of the equilibrium at a state, for the method that has just relaxed it. Only
/// for one curve.
class LinearizedBalance {
 public:
  virtual ~LinearizedBalance() = default;
  /// Factors the Hessian at a state. Returns false if it is not positive definite.
  virtual bool Factor(const WireState& state) = 0;
  /// Tangent planes of the steps at the state of the last Factor.
  virtual const std::vector<Frame>& frames() const = 0;
  /// Returns the step, by xi and spin, with Hessian * step = - `gradient`. Needs a successful
  /// Factor at the same state. Valid until the next call.
  virtual const CurveStep& Solve(const WireState& state, const CurveStep& gradient) = 0;
};

/// Motion of the instruments by a part.
struct PartMotion {
  InstrumentPoses here;
  InstrumentPoses next;
  double fraction = 1;  ///< of the remaining motion; see TimedTerm::SetMotionFraction
};

/// Follows the parts of a motion. Calls come after those of the energy terms' functions of the same
/// name, except EndPart. A follower changes neither the state nor the method.
class PartFollower {
 public:
  virtual ~PartFollower() = default;
  virtual void Restart(const WireState& state) = 0;
  virtual void BeginPart() = 0;
  /// `state`: after the motion, before it is relaxed.
  virtual void MovePart(const PartMotion& motion, const WireState& state) = 0;
  /// Comes before EnergyTerm::End. `state`: relaxed as far as this part is.
  virtual void EndPart(const WireState& state, LinearizedBalance& balance) = 0;
};

}  // namespace torquer
