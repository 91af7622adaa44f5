// What a wire in balance bears, and what the wall does to it, node by node.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// What one of two curves does to the other at a place in the lumen.
struct LumenLoad {
  int segment;
  double past_mm;           ///< past the segment's proximal node
  Eigen::Vector3d force_N;  ///< on the curve
  /// What the hand does not feel of the force along the curve. The place of the contact stays where
  /// the longer curve slides along itself, and goes along where the shorter one does.
  double unfelt_N;
};

/// All that acts on a curve, but for moments.
struct CurveLoads {
  std::vector<Eigen::Vector3d> point_gradient_N;  ///< at its points: minus what acts there
  std::vector<LumenLoad> in_lumen;                ///< of the other curve; from the sheath on
  /// Allocates for as many points, and as many places in a lumen.
  void Reserve(std::size_t points, std::size_t places) {
    point_gradient_N.reserve(points);
    in_lumen.reserve(2 * places);
  }
};

/// One entry a node, 0 .. n; of all instruments on the curve that reaches farthest together, but
/// that contacts with the wall are those of what touches it there. Internal forces and moments
/// are those of what is distal of the node on what is proximal.
struct InternalForces {
  std::vector<Eigen::Vector3d> contact_N;  ///< of the wall on the wire: normal force and friction
  std::vector<double> line_load_N_mm;      ///< normal force per length of wire, >= 0
  std::vector<double> tension_N;           ///< along the wire; negative where it is pushed
  std::vector<double> bending_mJ;          ///< bending moment (N mm), >= 0
  /// About the tangent; positive where the distal part is turned ahead, right-handed.
  std::vector<double> twisting_mJ;
  Eigen::Vector3d clamp_force_N = Eigen::Vector3d::Zero();    ///< on the wire, where it is clamped
  Eigen::Vector3d clamp_moment_mJ = Eigen::Vector3d::Zero();  ///< the same, about node 0
  PointDerivatives friction;  ///< at the points: of the terms that act on the surface
  /// At the points of a wire that does not twist: of friction at the surface about the axis,
  /// right-handed. The hand feels it; the wire's shape and the moment at the clamp do not.
  std::vector<double> surface_torque_mJ;
  CurveLoads loads;
};

/// Finds what acts on a curve of the state of which `expansion` is. O(points); allocates only where
/// `out` has not seen as many.
void FindCurveLoads(const WireState& state, const Expansion& expansion, bool second,
                    CurveLoads& out);

/// Finds them at the state of which `expansion` is (README section 15). `terms`: those of the
/// expansion. O(n); allocates only where `out` has not seen a wire as long.
void FindInternalForces(const WireModel& model, const WireState& state, const Expansion& expansion,
                        const std::vector<EnergyTerm*>& terms, InternalForces& out);

}  // namespace torquer
