// Second-order expansions of the energy of one joint (README, sections 2 and 10).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "host/simulator/core/bending.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

inline Frame TangentFrame(const Eigen::Vector3d& tangent, const Eigen::Vector3d& normal) {
  Frame frame;
  frame.col(0) = normal;
  frame.col(1) = tangent.cross(normal);
  return frame;
}

/// Second-order expansion of the energy of joint i in xi_{i-1} (proximal) and xi_i (distal), mJ.
struct JointTerms {
  Eigen::Vector2d gradient_proximal;
  Eigen::Vector2d gradient_distal;
  Eigen::Matrix2d hessian_proximal;
  Eigen::Matrix2d hessian_distal;
  Eigen::Matrix<double, 2, 2, Eigen::RowMajor> hessian_cross;  ///< rows: proximal, columns: distal
};

/// What the spins zeta_{i-1} and zeta_i of the segments of joint i add to its expansion, for a wire
/// that twists: turns about the tangents as they are after the steps xi. mJ.
struct TwistTerms {
  double gradient_proximal;
  double gradient_distal;
  double hessian_proximal;
  double hessian_distal;
  double hessian_cross;
  Eigen::Vector2d proximal_proximal;  ///< d2 / d zeta_{i-1} d xi_{i-1}
  Eigen::Vector2d proximal_distal;    ///< d2 / d zeta_{i-1} d xi_i
  Eigen::Vector2d distal_proximal;    ///< d2 / d zeta_i d xi_{i-1}
  Eigen::Vector2d distal_distal;      ///< d2 / d zeta_i d xi_i
  /// d2 / d zeta_i d (displacement of node i); loads on the segment alone have it. N.
  Eigen::Vector3d distal_displacement;
};

/// What the spin of the proximal segment does to the bending of a joint that rests curved.
struct RestSpinTerms {
  double gradient = 0;                  ///< d / d zeta_{i-1}, mJ
  double hessian = 0;                   ///< d2 / d zeta_{i-1}^2, mJ
  Eigen::Vector2d with_proximal{0, 0};  ///< d2 / d zeta_{i-1} d xi_{i-1}, mJ
  Eigen::Vector2d with_distal{0, 0};    ///< d2 / d zeta_{i-1} d xi_i, mJ
};

/// Joint i of a wire that does not twist: how the untwisted frames turn about their tangents,
/// zeta_i = zeta_{i-1} + proximal . xi_{i-1} + distal . xi_i (README (36)), and what that does to
/// the joint itself where it rests curved.
struct TurnTerms {
  Eigen::Vector2d proximal;
  Eigen::Vector2d distal;
  RestSpinTerms rest;
};

/// Second-order expansion of one joint; `rest` is the rest direction of `tangent`, carried by the
/// proximal segment with tangent `proximal_tangent` and normal `proximal_normal`.
/// `stiffness_mJ` = EI / (length that the joint stands for). Adds the energy to `energy_mJ`.
void ExpandJoint(BendingLaw law, double stiffness_mJ, const Eigen::Vector3d& proximal_tangent,
                 const Eigen::Vector3d& proximal_normal, const Eigen::Vector3d& rest,
                 const Eigen::Vector3d& tangent, const Eigen::Vector3d& normal, double& energy_mJ,
                 JointTerms& out);

/// The same for a joint that rests straight, with the frames given: a tenth of the work.
void ExpandStraightJoint(BendingLaw law, double stiffness_mJ,
                         const Eigen::Vector3d& proximal_tangent, const Frame& proximal_frame,
                         const Eigen::Vector3d& tangent, const Frame& frame, double& energy_mJ,
                         JointTerms& out);

/// How a joint's twist grows with the steps of its segments, xi: by g_p.xi_{i-1} + g_d.xi_i, (27).
struct TwistGeometry {
  TwistGeometry(const Eigen::Vector3d& proximal_tangent, const Frame& proximal_frame,
                const Eigen::Vector3d& tangent, const Frame& frame);
  Eigen::Vector2d g_p;
  Eigen::Vector2d g_d;
  Eigen::Vector2d h_p;
  Eigen::Vector2d h_d;
  Eigen::Matrix2d across;
  double part;
};

/// Adds what a joint's twist, of this stiffness and with this torque, adds to the expansion of its
/// bending, (28), (29); without the energy.
void BearTwist(double stiffness_mJ, double torque_mJ, const TwistGeometry& geometry,
               JointTerms& bending);

/// Adds the energy `stiffness_mJ` twist_rad^2 / 2 of a twisted joint, stiffness_mJ = GJ / (length
/// that the joint stands for), to the expansion of the same joint's bending.
void AddTwist(double stiffness_mJ, double twist_rad, const Eigen::Vector3d& proximal_tangent,
              const Frame& proximal_frame, const Eigen::Vector3d& tangent, const Frame& frame,
              double& energy_mJ, JointTerms& bending, TwistTerms& out);

/// The same where the twisting moment `torque_mJ` passes: adds its work on the twist of the joint,
/// to second order in the steps of its segments, and says in `turn` how far these turn the
/// untwisted frames. `turn.rest` stays as it is.
void ExpandStraightJoint(BendingLaw law, double stiffness_mJ,
                         const Eigen::Vector3d& proximal_tangent, const Frame& proximal_frame,
                         const Eigen::Vector3d& tangent, const Frame& frame, double torque_mJ,
                         double& energy_mJ, JointTerms& out, TurnTerms& turn);

/// Adds what the twisting moment does to the expansion of a joint that rests curved.
void AddTorque(double torque_mJ, const Eigen::Vector3d& proximal_tangent,
               const Frame& proximal_frame, const Eigen::Vector3d& tangent, const Frame& frame,
               JointTerms& bending, TurnTerms& turn);

/// What the spin of the proximal segment does to the bending of a joint that rests curved. All as
/// for ExpandJoint.
RestSpinTerms SpinOfRest(BendingLaw law, double stiffness_mJ,
                         const Eigen::Vector3d& proximal_tangent,
                         const Eigen::Vector3d& proximal_normal, const Eigen::Vector3d& rest,
                         const Eigen::Vector3d& tangent, const Frame& frame);

}  // namespace torquer
