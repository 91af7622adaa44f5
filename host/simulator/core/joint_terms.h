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

/// Spin terms of a joint's expansion, for a wire that twists. The spins zeta_{i-1} and zeta_i turn
/// the segments about their tangents, as these are after the steps xi. mJ.
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
  /// d2 / d zeta_i d (displacement of node i); only loads on the segment contribute. N.
  Eigen::Vector3d distal_displacement;
};

/// Effect of the proximal segment's spin on the bending of a joint that rests curved.
struct RestSpinTerms {
  double gradient = 0;                  ///< d / d zeta_{i-1}, mJ
  double hessian = 0;                   ///< d2 / d zeta_{i-1}^2, mJ
  Eigen::Vector2d with_proximal{0, 0};  ///< d2 / d zeta_{i-1} d xi_{i-1}, mJ
  Eigen::Vector2d with_distal{0, 0};    ///< d2 / d zeta_{i-1} d xi_i, mJ
};

/// Turn of the untwisted frames about their tangents at joint i of a wire that does not twist. It
/// is zeta_i = zeta_{i-1} + proximal . xi_{i-1} + distal . xi_i (README (36)). `rest` is its effect
/// on the joint itself if the joint rests curved.
struct TurnTerms {
  Eigen::Vector2d proximal;
  Eigen::Vector2d distal;
  RestSpinTerms rest;
};

/// Second-order expansion of one joint. `rest` is the rest direction of `tangent`, carried by the
/// proximal segment with tangent `proximal_tangent` and normal `proximal_normal`. `stiffness_mJ` =
/// EI / (length that the joint stands for). Adds the energy to `energy_mJ`.
void ExpandJoint(BendingLaw law, double stiffness_mJ, const Eigen::Vector3d& proximal_tangent,
                 const Eigen::Vector3d& proximal_normal, const Eigen::Vector3d& rest,
                 const Eigen::Vector3d& tangent, const Eigen::Vector3d& normal, double& energy_mJ,
                 JointTerms& out);

/// Like ExpandJoint, for a joint that rests straight and with the frames given: a tenth of the
/// work.
void ExpandStraightJoint(BendingLaw law, double stiffness_mJ,
                         const Eigen::Vector3d& proximal_tangent, const Frame& proximal_frame,
                         const Eigen::Vector3d& tangent, const Frame& frame, double& energy_mJ,
                         JointTerms& out);

/// Growth of a joint's twist with the steps xi of its segments: g_p.xi_{i-1} + g_d.xi_i, (27).
struct TwistGeometry {
  TwistGeometry(const Eigen::Vector3d& proximal_tangent, const Frame& proximal_frame,
                const Eigen::Vector3d& tangent, const Frame& frame);
  Eigen::Vector2d g_p;
  Eigen::Vector2d g_d;
  Eigen::Vector2d h_p;
  Eigen::Vector2d h_d;
  Eigen::Matrix2d across;
  double factor;
};

/// Adds the twist terms (28), (29) of a joint with this stiffness and torque to the expansion of
/// its bending. Does not add the energy.
void AddTwistTerms(double stiffness_mJ, double torque_mJ, const TwistGeometry& geometry,
                   JointTerms& bending);

/// Adds the energy `stiffness_mJ` twist_rad^2 / 2 of a twisted joint to the expansion of the same
/// joint's bending. The stiffness is GJ / (length that the joint stands for).
void AddTwist(double stiffness_mJ, double twist_rad, const Eigen::Vector3d& proximal_tangent,
              const Frame& proximal_frame, const Eigen::Vector3d& tangent, const Frame& frame,
              double& energy_mJ, JointTerms& bending, TwistTerms& out);

/// Like ExpandStraightJoint above, for a joint that transmits the twisting moment `torque_mJ`. Adds
/// the moment's work on the joint's twist, to second order in the steps of the joint's segments.
/// Sets in `turn` the turn of the untwisted frames; `turn.rest` is unchanged.
void ExpandStraightJoint(BendingLaw law, double stiffness_mJ,
                         const Eigen::Vector3d& proximal_tangent, const Frame& proximal_frame,
                         const Eigen::Vector3d& tangent, const Frame& frame, double torque_mJ,
                         double& energy_mJ, JointTerms& out, TurnTerms& turn);

/// Adds the effect of the twisting moment to the expansion of a joint that rests curved.
void AddTorque(double torque_mJ, const Eigen::Vector3d& proximal_tangent,
               const Frame& proximal_frame, const Eigen::Vector3d& tangent, const Frame& frame,
               JointTerms& bending, TurnTerms& turn);

/// Effect of the proximal segment's spin on the bending of a joint that rests curved. Arguments as
/// for ExpandJoint.
RestSpinTerms SpinOfRest(BendingLaw law, double stiffness_mJ,
                         const Eigen::Vector3d& proximal_tangent,
                         const Eigen::Vector3d& proximal_normal, const Eigen::Vector3d& rest,
                         const Eigen::Vector3d& tangent, const Frame& frame);

}  // namespace torquer
