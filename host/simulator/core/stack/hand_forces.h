// Hand forces: force and torque at the hand of each instrument of a stack.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/internal_forces.h"
#include "host/simulator/core/stack/combined_rods.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Force and torque of a hand that hold its instrument in place. A haptic device renders the
/// opposite.
struct HandForce {
  double axial_N = 0;    ///< positive for a distal push
  double torque_mJ = 0;  ///< positive for a forward turn, right-handed about the distal tangent
};

/// Sliding between instruments.
struct Sliding {
  double coefficient = 0;  ///< of friction between them, >= 0
  /// [k][m]: 1 if instrument k last slid distally in m, -1 for the other way, 0 before any sliding.
  std::array<std::array<int, kMostInstruments>, kMostInstruments> direction = {};
};

/// Finds the force and torque of every hand (README section 16). It balances each instrument from
/// its tip to the sheath, curve by curve. Reuses its buffers between calls.
class HandForces {
 public:
  /// `forces`: result of FindInternalForces for the state of `quadratic`. O(n).
  void Find(const CombinedRods& rods, const WireState& state, const QuadraticModel& quadratic,
            const InternalForces& forces, const Sliding& sliding);
  /// Finds only the contact force of each instrument against the next one around it on its curve,
  /// by segment. This is PointSet::Between::pressed_N of `quadratic`. Has no effect if the
  /// coefficient is 0. O(n); no heap after Reserve.
  void FindPressed(const CombinedRods& rods, const WireState& state, const Sliding& sliding,
                   QuadraticModel& quadratic);
  /// Reserves room for rods of `segments` segments.
  void Reserve(int segments, int points_per_segment);
  /// Results per instrument, the innermost first; zero for an instrument that is not inside.
  const std::array<HandForce, kMostInstruments>& hands() const { return hands_; }

 private:
  // A curve with its instruments `range.first` to `range.last` - 1, and its loads.
  struct OnCurve {
    const WireModel& rod;
    const Curve& curve;
    const CurveQuadraticModel& at;
    int number;
    InstrumentStack::Range range;
    const CurveLoads& loads;
  };

  // Internal loads of an instrument at the current node of the balance. Same vector convention as
  // InternalForces.
  struct SectionForces {
    Eigen::Vector3d moment_mJ = Eigen::Vector3d::Zero();         // at the node
    Eigen::Vector3d moment_before_mJ = Eigen::Vector3d::Zero();  // at the node before it
    Eigen::Vector3d force_N = Eigen::Vector3d::Zero();           // in the segment beyond the node
    Eigen::Vector3d force_before_N = Eigen::Vector3d::Zero();    // in the segment before the node
    double friction_N = 0;  // from other instruments, at the node, positive distally
    bool inside = false;    // it reaches the node
  };

  static OnCurve CurveOf(const CombinedRods& rods, const WireState& state,
                         const QuadraticModel& quadratic, int number, const CurveLoads& loads);
  void FindOnCurve(const InstrumentStack& stack, const OnCurve& on, const InternalForces& forces,
                   const Sliding& sliding);
  void BalanceAll(const InstrumentStack& stack, const OnCurve& on, const Sliding& sliding);
  void DistributeLoads(const InstrumentStack& stack, const OnCurve& on);
  void FindMoments(const JointIntegrals& integrals, const OnCurve& on, int joint);
  void FindPairMoments(const JointIntegrals& integrals, const OnCurve& on, int joint);
  void Balance(const OnCurve& on, int node, const Sliding& sliding);
  void FindFriction(const OnCurve& on, int node, const Sliding& sliding);

  CurveLoads loads_;  // of a curve, if no InternalForces have them
  std::array<HandForce, kMostInstruments> hands_;
  std::array<SectionForces, kMostInstruments> section_forces_;
  std::array<int, kMostInstruments> order_ = {};  // on a curve, in order of decreasing reach
  int count_ = 0;                                 // entries of order_ in use
  // Load on each instrument, one entry per node.
  std::array<std::vector<Eigen::Vector3d>, kMostInstruments> load_N_;
  // Force of each instrument against the next one around it, one entry per node.
  std::vector<std::array<double, kMostInstruments>> pressed_N_;
};

}  // namespace torquer
