// Discretization error: distance to the wire with ever finer segments, to leading order.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/core/curve.h"
#include "host/simulator/core/curve_mechanics.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

/// Defect of a state in equilibrium: the out-of-balance forces of the smooth wire through the same
/// curve (README section 19). Only for a wire that does not twist. No heap after Reserve.
class DiscretizationDefect {
 public:
  void Reserve(int max_segments);
  /// Replaces the gradients of `quadratic`, which is that of `state`, by those of the defect. Minus
  /// the Newton step for them turns the segments to those of the smooth wire.
  void ReplaceGradients(const WireModel& model, const Curve& curve, CurveQuadraticModel& quadratic);
  /// Backward shift of every node along its own curve, mm, because arcs are longer than their
  /// chords. Add it to the node displacements of the step.
  const std::vector<Eigen::Vector3d>& shift_mm() const { return shift_mm_; }

 private:
  void FindMoments(const WireModel& model, const Curve& curve);
  Eigen::Vector3d MissedBend(const WireModel& model, const Curve& curve, int joint) const;

  std::vector<Eigen::Vector3d> moment_mJ_;  // of each joint's spring, acting on its distal segment
  std::vector<Eigen::Vector3d> law_rad_;    // excess bend of each joint due to its bending law
  std::vector<Eigen::Vector3d> curvature_;  // of each segment's arc, towards its center, 1/mm
  std::vector<Eigen::Vector3d> shift_mm_;   // n + 1
};

}  // namespace torquer
