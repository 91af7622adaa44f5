// What the hands of instruments within each other feel.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "host/simulator/core/instrument_place.h"
#include "host/simulator/core/internal_forces.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// What a hand does to its instrument to hold it where it is. A haptic device renders the opposite.
struct HandForce {
  double axial_N = 0;    ///< positive where it pushes distally
  double torque_mJ = 0;  ///< positive where it turns ahead, right-handed about the distal tangent
};

/// How instruments slide in each other.
struct Sliding {
  double coefficient = 0;  ///< of friction between them, >= 0
  /// [k][m]: 1 where instrument k slides distally in m, -1 the other way, 0 where it has not yet.
  std::array<std::array<int, kMostInstruments>, kMostInstruments> direction = {};
};

/// Finds the force and torque of every instrument's hand, by the balance of each from its tip to
/// the sheath, curve by curve (README section 16). Keeps its room from one wire to the next.
class HandForces {
 public:
  /// `forces`: what FindInternalForces found at the state of which `expansion` is. O(n).
  void Find(const InstrumentStack& stack, const WireState& state, const Expansion& expansion,
            const InternalForces& forces, const Sliding& sliding);
  /// Finds alone what presses each instrument against the next one around it, by segment, as
  /// PointSet::pressed_N has it, where they lie on one curve. A coefficient of 0 finds nothing.
  /// O(n); no heap after Reserve.
  void FindPressed(const InstrumentStack& stack, const WireState& state, const Expansion& expansion,
                   const Sliding& sliding, std::vector<std::array<double, kMostInstruments>>& out);
  /// Makes room for rods of so many segments.
  void Reserve(int segments, int points_per_segment);
  /// Of each instrument, the innermost first; nothing for one that is not inside.
  const std::array<HandForce, kMostInstruments>& hands() const { return hands_; }

 private:
  // A curve with its instruments, `first` to `last` - 1, and what acts on it.
  struct Curve {
    const WireModel& rod;
    const WireState& state;
    const Expansion& at;
    bool second;
    InstrumentStack::Range range;
    const CurveLoads& loads;
  };

  // What an instrument bears where the balance has come to. Vectors as InternalForces counts them.
  struct Bears {
    Eigen::Vector3d moment_mJ = Eigen::Vector3d::Zero();         // at the node
    Eigen::Vector3d moment_before_mJ = Eigen::Vector3d::Zero();  // at the node before it
    Eigen::Vector3d force_N = Eigen::Vector3d::Zero();           // in the segment beyond the node
    Eigen::Vector3d force_before_N = Eigen::Vector3d::Zero();    // in that before it
    double friction_N = 0;  // of other instruments on it, at the node, distally
    bool inside = false;    // reaches as far as the node
  };

  // What an instrument is at a joint, and all that reach as far as it together.
  struct Share {
    double rigidity_N_mm2 = 0;
    Eigen::Vector3d rest_1_mm = Eigen::Vector3d::Zero();
    double piece = 0;  // part of the joint in which it is the last of them
    double sum_EI = 0;
    Eigen::Vector3d sum_EI_rest = Eigen::Vector3d::Zero();
  };

  static Curve CurveOf(const InstrumentStack& stack, const WireState& state,
                       const Expansion& expansion, bool second, const CurveLoads& loads);
  void FindOnCurve(const InstrumentStack& stack, const Curve& curve, const PointSet& points,
                   const InternalForces& forces, const Sliding& sliding);
  void BalanceAll(const InstrumentStack& stack, const Curve& curve, const PointSet& points,
                  const Sliding& sliding);
  void ShareLoads(const InstrumentStack& stack, const Curve& curve, const PointSet& points);
  void FindMoments(const InstrumentStack& stack, const Curve& curve, int joint);
  void Balance(const Curve& curve, int node, const Sliding& sliding);
  void FindFriction(const Curve& curve, int node, const Sliding& sliding);

  CurveLoads second_loads_;
  CurveLoads loads_;  // of the first curve, where no InternalForces have them
  std::array<HandForce, kMostInstruments> hands_;
  std::array<Bears, kMostInstruments> bears_;
  std::array<int, kMostInstruments> order_ = {};  // on a curve, the one that reaches farthest first
  int count_ = 0;                                 // of these
  std::array<Share, kMostInstruments> shares_;    // in that order
  // On each instrument, one a node.
  std::array<std::vector<Eigen::Vector3d>, kMostInstruments> load_N_;
  // Of each instrument against the next one around it, one a node.
  std::vector<std::array<double, kMostInstruments>> pressed_N_;
};

}  // namespace torquer
