// Second-order expansion of a joint of instruments that twist, each by itself (README, section 17).
#pragma once

#include <Eigen/Core>

#include "host/simulator/core/curve.h"
#include "host/simulator/core/joint_terms.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

/// Spin terms in the expansion of joint i, one per instrument of the rod: TwistTerms of each, and
/// their couplings. Rows beyond the number of instruments are zero. mJ.
struct StackTerms {
  using Spins = Eigen::Matrix<double, kMostInstruments, 1>;
  using SpinsWithStep = Eigen::Matrix<double, kMostInstruments, 2>;

  Spins gradient_proximal;
  Spins gradient_distal;
  Eigen::Matrix<double, kMostInstruments, kMostInstruments> hessian_proximal;
  Eigen::Matrix<double, kMostInstruments, kMostInstruments> hessian_distal;
  Spins hessian_cross;  ///< diagonal
  SpinsWithStep proximal_proximal;
  SpinsWithStep proximal_distal;
  SpinsWithStep distal_proximal;
  SpinsWithStep distal_distal;
  Eigen::Matrix<double, kMostInstruments, 3> distal_displacement;  ///< N
};

/// Expands joint i: its bending, its twists, and the coupling (38) of instruments that rest
/// differently. `proximal_frame` and `frame` are the tangent planes of its segments. Adds the
/// energy to `energy_mJ`.
void ExpandStackJoint(const WireModel& model, const Curve& curve, int joint,
                      const Frame& proximal_frame, const Frame& frame, double& energy_mJ,
                      JointTerms& bending, StackTerms& out);

/// GJ over the length that joint i stands for, of an instrument that twists, lone or in a stack,
/// mJ.
double TwistStiffnessOf(const WireModel& model, const Curve& curve, int joint, int instrument);

}  // namespace torquer
