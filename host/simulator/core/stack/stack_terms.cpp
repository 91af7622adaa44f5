#include "host/simulator/core/stack/stack_terms.h"

#include <cmath>

namespace torquer {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

using Contribution = WireModel::TwistingJoint::Contribution;

Vector2d QuarterTurn(const Vector2d& a) { return {-a[1], a[0]}; }

// Contributions of the instruments to the rest angle of a joint, in their local turn.
struct Rests {
  Rests(const WireModel& model, const Curve& curve, int joint)
      : twisting(model.twisting_joint(curve.segments() - joint)),
        first(model.first_spin()),
        count(model.spins()),
        fraction(JointLength(model, curve, joint) / model.segment_mm()) {
    for (int k = 0; k < count; ++k) {
      own[k].setZero();
      if (!Curved(k)) continue;
      const double turn = curve.TurnBefore(joint, first + k);
      const Vector2d bend = fraction * Of(k).bend_rad;
      own[k] = std::cos(turn) * bend + std::sin(turn) * QuarterTurn(bend);
      together += own[k];
      curved = true;
    }
  }

  // Instrument number k of the rod.
  const Contribution& Of(int k) const { return twisting.of[first + k]; }
  bool Curved(int k) const { return !Of(k).bend_rad.isZero(0); }

  const WireModel::TwistingJoint& twisting;
  const int first;
  const int count;
  const double fraction;  // length of the joint over that of a segment
  std::array<Vector2d, kMostInstruments> own;
  Vector2d together = Vector2d::Zero();
  bool curved = false;
};

// Energy of two instruments that bend each other, with its derivatives by the turn from a to b.
struct MutualBend {
  double energy_mJ;
  double first;
  double second;
};

// Calls `each` with two instruments that bend each other.
template <class Each>
void ForPairs(const Rests& rests, const Curve& curve, int joint, const Each& each) {
  for (int a = 0; a < rests.count; ++a) {
    for (int b = a + 1; b < rests.count; ++b) {
      const auto& mutual = rests.twisting.mutual[rests.first + a][rests.first + b];
      if (mutual.constant_mJ == 0) continue;  // both are straight
      const double turn =
          curve.TurnBefore(joint, rests.first + b) - curve.TurnBefore(joint, rests.first + a);
      const double c = std::cos(turn);
      const double s = std::sin(turn);
      const double even = rests.fraction * (mutual.along_mJ * c + mutual.across_mJ * s);
      const double odd = rests.fraction * (mutual.along_mJ * s - mutual.across_mJ * c);
      each(a, b, MutualBend{rests.fraction * mutual.constant_mJ - even, odd, even});
    }
  }
}

// BentDirection with its first and second derivatives, in the frame (first normal, second normal,
// tangent).
struct BentTwice {
  explicit BentTwice(const Vector2d& angle) {
    // cos and sin(x)/x as functions of x^2, with two derivatives.
    const double q = angle.squaredNorm();
    double c = 0;
    double s = 0;
    double s1 = 0;
    double s2 = 0;
    if (q < 1e-2) {
      c = 1 - q / 2 * (1 - q / 12 * (1 - q / 30 * (1 - q / 56)));
      s = 1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72)));
      s1 = -1.0 / 6 * (1 - q / 10 * (1 - q / 28 * (1 - q / 54)));
      s2 = 1.0 / 60 * (1 - q / 14 * (1 - q / 36 * (1 - q / 66)));
    } else {
      const double x = std::sqrt(q);
      c = std::cos(x);
      s = std::sin(x) / x;
      s1 = (c - s) / (2 * q);
      s2 = (-s / 2 - 3 * s1) / (2 * q);
    }
    const double c1 = -s / 2;
    const double c2 = -s1 / 2;
    direction << s * angle, c;
    for (int a = 0; a < 2; ++a) {
      first[a] << 2 * angle[a] * s1 * angle, 2 * angle[a] * c1;
      first[a][a] += s;
    }
    for (int a = 0; a < 2; ++a) {
      for (int b = 0; b < 2; ++b) {
        const double same = a == b ? 2 : 0;
        const double both = 4 * angle[a] * angle[b];
        second[a][b] << (same * s1 + both * s2) * angle, same * c1 + both * c2;
        second[a][b][b] += 2 * angle[a] * s1;
        second[a][b][a] += 2 * angle[b] * s1;
      }
    }
  }
  Vector3d direction;
  Vector3d first[2];
  Vector3d second[2][2];
};

}  // namespace

double TwistStiffnessOf(const WireModel& model, const Curve& curve, int joint, int instrument) {
  if (model.twists()) return TwistStiffness(model, curve, joint);
  return model.twisting_joint(curve.segments() - joint).of[instrument].torsional_rigidity_N_mm2 /
         JointLength(model, curve, joint);
}

void ExpandStackJoint(const WireModel& model, const Curve& curve, int joint,
                      const Frame& proximal_frame, const Frame& frame, double& energy_mJ,
                      JointTerms& bending, StackTerms& out) {
  const Vector3d& proximal = joint == 0 ? model.sheath().direction : curve.tangents()[joint - 1];
  const Vector3d& tangent = curve.tangents()[joint];
  const double length_mm = JointLength(model, curve, joint);
  const double stiffness = JointStiffness(model, curve, joint);
  out.gradient_proximal.setZero();
  out.hessian_proximal.setZero();
  out.proximal_proximal.setZero();
  out.proximal_distal.setZero();
  out.gradient_distal.setZero();
  out.hessian_distal.setZero();
  out.hessian_cross.setZero();
  out.distal_proximal.setZero();
  out.distal_distal.setZero();
  out.distal_displacement.setZero();

  const Rests rests(model, curve, joint);
  if (!rests.curved) {
    ExpandStraightJoint(model.law(), stiffness, proximal, proximal_frame, tangent, frame, energy_mJ,
                        bending);
  } else {
    const BentTwice bent(rests.together);
    Eigen::Matrix3d axes;
    axes << proximal_frame, proximal;
    const Vector3d rest = axes * bent.direction;
    ExpandJoint(model.law(), stiffness, proximal, proximal_frame.col(0), rest, tangent,
                frame.col(0), energy_mJ, bending);

    // Derivatives of y = 1 - u.r by the spins, through the rest angle. As in ExpandJoint, the rest
    // turns with the proximal segment by e_1 xi_1 + e_2 xi_2.
    const double y = (tangent - rest).squaredNorm() / 2;
    const BendingValue v = EvaluateBending(model.law(), y);
    const double slope = stiffness * v.slope;
    const double curvature = stiffness * v.curvature;
    const Vector3d e1 = proximal_frame.col(1);
    const Vector3d e2 = -proximal_frame.col(0);
    const Vector3d moment = rest.cross(tangent);
    const Vector2d y_distal = -frame.transpose() * rest;
    const Vector2d y_proximal(-e1.dot(moment), -e2.dot(moment));
    Vector2d y_rest;
    Matrix2d y_rest_rest;
    Matrix2d rest_proximal;  // rows: the components of the rest angle
    Matrix2d rest_distal;
    for (int a = 0; a < 2; ++a) {
      const Vector3d r = axes * bent.first[a];
      const Vector3d across = r.cross(tangent);
      y_rest[a] = -r.dot(tangent);
      rest_proximal.row(a) << -e1.dot(across), -e2.dot(across);
      rest_distal.row(a) = -r.transpose() * frame;
      for (int b = 0; b < 2; ++b) y_rest_rest(a, b) = -tangent.dot(axes * bent.second[a][b]);
    }
    for (int k = 0; k < rests.count; ++k) {
      if (!rests.Curved(k)) continue;
      const Vector2d& own = rests.own[k];
      const Vector2d turned = QuarterTurn(own);
      const double y_k = y_rest.dot(turned);
      out.gradient_proximal[k] += slope * y_k;
      out.hessian_proximal(k, k) -= slope * y_rest.dot(own);
      out.proximal_proximal.row(k) +=
          curvature * y_k * y_proximal.transpose() + slope * turned.transpose() * rest_proximal;
      out.proximal_distal.row(k) +=
          curvature * y_k * y_distal.transpose() + slope * turned.transpose() * rest_distal;
      for (int m = 0; m < rests.count; ++m) {
        const Vector2d with = QuarterTurn(rests.own[m]);
        out.hessian_proximal(k, m) +=
            curvature * y_k * y_rest.dot(with) + slope * turned.dot(y_rest_rest * with);
      }
    }
  }
  // Even where contributions to the rest angle cancel, instruments bend each other.
  ForPairs(rests, curve, joint, [&](int a, int b, const MutualBend& bend) {
    energy_mJ += bend.energy_mJ;
    out.gradient_proximal[a] -= bend.first;
    out.gradient_proximal[b] += bend.first;
    out.hessian_proximal(a, a) += bend.second;
    out.hessian_proximal(b, b) += bend.second;
    out.hessian_proximal(a, b) -= bend.second;
    out.hessian_proximal(b, a) -= bend.second;
  });

  const TwistGeometry geometry(proximal, proximal_frame, tangent, frame);
  double sum_stiffness = 0;
  double sum_torque = 0;
  for (int k = 0; k < rests.count; ++k) {
    const double own = rests.Of(k).torsional_rigidity_N_mm2 / length_mm;
    const double twist = curve.TwistOf(joint, rests.first + k);
    const double torque = own * twist;
    energy_mJ += torque * twist / 2;
    sum_stiffness += own;
    sum_torque += torque;
    out.gradient_proximal[k] -= torque;
    out.gradient_distal[k] += torque;
    out.hessian_proximal(k, k) += own;
    out.hessian_distal(k, k) += own;
    out.hessian_cross[k] -= own;
    out.proximal_proximal.row(k) -= own * geometry.g_p.transpose();
    out.proximal_distal.row(k) -= own * geometry.g_d.transpose();
    out.distal_proximal.row(k) += own * geometry.g_p.transpose();
    out.distal_distal.row(k) += own * geometry.g_d.transpose();
  }
  AddTwistTerms(sum_stiffness, sum_torque, geometry, bending);
}

}  // namespace torquer
