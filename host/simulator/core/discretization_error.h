// How far the finer wire would lie: what cutting a wire into segments leaves out, to leading order.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// The defect of a state in balance: by how much the smooth wire through the same curve would be
/// out of balance (README section 19). Of a wire that does not twist. No heap after Reserve.
class DiscretizationDefect {
 public:
  void Reserve(int max_segments);
  /// Makes the gradients of `expansion`, that of the state, those of the defect: minus the Newton
  /// step for them is what turns the segments to where those of the smooth wire are.
  void Put(const WireModel& model, const WireState& state, Expansion& expansion);
  /// What every node is farther back by along its own curve, as arcs are longer than their chords,
  /// mm; to be added to what the step displaces it by.
  const std::vector<Eigen::Vector3d>& shift_mm() const { return shift_mm_; }

 private:
  void FindMoments(const WireModel& model, const WireState& state);
  Eigen::Vector3d MissedBend(const WireModel& model, const WireState& state, int joint) const;

  std::vector<Eigen::Vector3d> moment_mJ_;  // of each joint's spring, of its distal segment
  std::vector<Eigen::Vector3d> law_rad_;    // what its law bends it too far by
  std::vector<Eigen::Vector3d> curvature_;  // of each segment's arc, towards its center, 1/mm
  std::vector<Eigen::Vector3d> shift_mm_;   // n + 1
};

}  // namespace torquer
