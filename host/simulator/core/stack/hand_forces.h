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
/// the sheath (README section 16). Keeps its room from one wire to the next.
class HandForces {
 public:
  /// `forces`: what FindInternalForces found at the state of which `points` are. O(n).
  void Find(const InstrumentStack& stack, const WireState& state, const PointSet& points,
            const InternalForces& forces, const Sliding& sliding);
  /// Finds alone what presses each instrument against the next one around it, by segment, as
  /// PointSet::pressed_N has it. `point_gradient_N`: that of FindPointGradients. A coefficient of 0
  /// finds nothing. O(n); no heap after Reserve.
  void FindPressed(const InstrumentStack& stack, const WireState& state, const PointSet& points,
                   const std::vector<Eigen::Vector3d>& point_gradient_N, const Sliding& sliding,
                   std::vector<std::array<double, kMostInstruments>>& out);
  /// Makes room for rods of so many segments.
  void Reserve(int segments);
  /// Of each instrument, the innermost first; nothing for one that is not inside.
  const std::array<HandForce, kMostInstruments>& hands() const { return hands_; }

 private:
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

  void BalanceAll(const InstrumentStack& stack, const WireState& state, const PointSet& points,
                  const std::vector<Eigen::Vector3d>& point_gradient_N, const Sliding& sliding);
  void ShareLoads(const PointSet& points, const std::vector<Eigen::Vector3d>& point_gradient_N,
                  std::size_t nodes);
  void FindMoments(const InstrumentStack& stack, const WireState& state, int joint);
  void Balance(const WireState& state, int node, const Sliding& sliding);
  void FindFriction(const WireState& state, int node, const Sliding& sliding);

  int count_ = 0;
  std::array<HandForce, kMostInstruments> hands_;
  std::array<Bears, kMostInstruments> bears_;
  std::array<int, kMostInstruments> order_ = {};  // the one that reaches farthest first
  std::array<Share, kMostInstruments> shares_;    // in that order
  // On each instrument, one a node.
  std::array<std::vector<Eigen::Vector3d>, kMostInstruments> load_N_;
  // Of each instrument against the next one around it, one a node.
  std::vector<std::array<double, kMostInstruments>> pressed_N_;
};

}  // namespace torquer
