// Internal forces and wall contact forces of a wire in equilibrium, per node.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/core/point_derivatives.h"
#include "host/simulator/core/point_set.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Force of another curve on a curve at a place in a lumen.
struct LumenLoad {
  int segment;
  double past_mm;           ///< distance past the segment's proximal node
  bool in_own_lumen;        ///< the place is in the lumen of this curve
  Eigen::Vector3d force_N;  ///< on the curve
  /// Part of the force along the curve that its hand does not feel. A wire that slides along its
  /// path does not change the contact. Only the end of the contact, a mouth or a tip, moves with
  /// its curve. So the hand of that curve feels the push along.
  double unfelt_N;
};

/// Forces on a curve; moments are not included.
struct CurveLoads {
  std::vector<Eigen::Vector3d> point_gradient_N;  ///< at its points: minus the force there
  std::vector<LumenLoad> in_lumen;                ///< from the other curves
  /// Allocates for `points` points and `places` places in a lumen.
  void Reserve(std::size_t points, std::size_t places) {
    point_gradient_N.reserve(points);
    in_lumen.reserve(2 * places);
  }
};

/// Internal forces at the nodes, one entry per node 0 .. n. They are sums over all instruments on
/// the curve that reaches farthest. Wall contacts: those of the outermost instrument at the node,
/// without those of a wire beside it. Internal forces and moments: those of the part distal of the
/// node on the proximal part.
struct InternalForces {
  std::vector<Eigen::Vector3d>
      contact_N;                       ///< force of the wall on the wire: normal force and friction
  std::vector<double> line_load_N_mm;  ///< normal force per length of wire, >= 0
  std::vector<double> tension_N;       ///< along the wire; negative under compression
  std::vector<double> bending_mJ;      ///< bending moment (N mm), >= 0
  /// About the tangent; positive where the distal part is turned ahead, right-handed.
  std::vector<double> twisting_mJ;
  Eigen::Vector3d clamp_force_N = Eigen::Vector3d::Zero();    ///< on the wire at the clamp
  Eigen::Vector3d clamp_moment_mJ = Eigen::Vector3d::Zero();  ///< the same, a moment about node 0
  /// By curve, at its points: sum over the terms that act on the surface.
  std::vector<PointDerivatives> friction;
  /// By curve, at its points if it does not twist: torque of surface friction about the axis,
  /// right-handed. The hand feels it; the wire's shape and the moment at the clamp do not.
  std::vector<std::vector<double>> surface_torque_mJ;
  CurveLoads loads;
};

/// Finds the loads on a curve of `state`. `quadratic`: that of `state`. O(points); allocates only
/// if `out` is too small.
void FindCurveLoads(const WireState& state, const QuadraticModel& quadratic, int curve,
                    CurveLoads& out);

/// Finds the internal forces of `state` (README section 15). `model`: that of the curve that
/// reaches farthest; `quadratic`: that of `state`; `terms`: those of the model. O(n); allocates
/// only if `out` is too small for the wire.
void FindInternalForces(const WireModel& model, const WireState& state,
                        const QuadraticModel& quadratic, const std::vector<EnergyTerm*>& terms,
                        InternalForces& out);

}  // namespace torquer
