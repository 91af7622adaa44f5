#include "host/simulator/core/joint_terms.h"

#include <Eigen/Geometry>

#include "host/simulator/core/pair.h"

namespace torquer {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

void ExpandJoint(BendingLaw law, double stiffness_mJ, const Vector3d& proximal_tangent,
                 const Vector3d& proximal_normal, const Vector3d& rest, const Vector3d& tangent,
                 const Vector3d& normal, double& energy_mJ, JointTerms& out) {
  // y = |u - r|^2 / 2 with u = tangent. The rest direction r turns with the proximal segment. The
  // rotation vector is phi = tangent_p x T_p xi_p = e1 xi_p1 + e2 xi_p2.
  const double y = (tangent - rest).squaredNorm() / 2;
  const BendingValue v = EvaluateBending(law, y);
  energy_mJ += stiffness_mJ * v.g;

  const Vector3d second = tangent.cross(normal);
  const Vector3d e1 = proximal_tangent.cross(proximal_normal);
  const Vector3d e2 = -proximal_normal;
  const Vector3d moment = rest.cross(tangent);
  const Vector2d y_distal(-rest.dot(normal), -rest.dot(second));
  const Vector2d y_proximal(-e1.dot(moment), -e2.dot(moment));
  const double c = 1 - y;
  const double slope = stiffness_mJ * v.slope;
  const double curvature = stiffness_mJ * v.curvature;

  out.gradient_distal = slope * y_distal;
  out.gradient_proximal = slope * y_proximal;
  out.hessian_distal = curvature * y_distal * y_distal.transpose();
  out.hessian_distal.diagonal().array() += slope * c;
  const Vector2d e_rest(e1.dot(rest), e2.dot(rest));
  const Vector2d e_tangent(e1.dot(tangent), e2.dot(tangent));
  out.hessian_proximal =
      curvature * y_proximal * y_proximal.transpose() -
      (slope / 2) * (e_rest * e_tangent.transpose() + e_tangent * e_rest.transpose());
  out.hessian_proximal.diagonal().array() += slope * c;
  const Vector3d rest_x_normal = rest.cross(normal);
  const Vector3d rest_x_second = rest.cross(second);
  Matrix2d cross;
  cross << e1.dot(rest_x_normal), e1.dot(rest_x_second), e2.dot(rest_x_normal),
      e2.dot(rest_x_second);
  out.hessian_cross = curvature * y_proximal * y_distal.transpose() - slope * cross;
}

namespace {

// Adds the work of a twisting moment on the twist of a joint, (27) to (29). Inputs: part = 1/(1 +
// c), h_p, h_d, and T_p' T_d by rows.
inline void AddTorqueTerms(double torque_mJ, double factor, Pair h_p, Pair h_d,
                           const Pair (&across)[2], JointTerms& bending, TurnTerms& turn) {
  const double weight = torque_mJ * factor;
  const Pair p = Pair{factor, -factor} * Swapped(h_p);
  const Pair d = Pair{-factor, factor} * Swapped(h_d);
  Store(p, turn.proximal.data());
  Store(d, turn.distal.data());
  Store(Load(bending.gradient_proximal.data()) - Both(torque_mJ) * p,
        bending.gradient_proximal.data());
  Store(Load(bending.gradient_distal.data()) - Both(torque_mJ) * d, bending.gradient_distal.data());

  // g is a quarter turn of h, so that (28) has no trace.
  const auto add = [](double scale, Pair h, Matrix2d& hessian) {
    const double along = scale * h[0] * h[1];
    const double cross = scale / 2 * (h[1] * h[1] - h[0] * h[0]);
    Store(Load(hessian.data()) + Pair{along, cross}, hessian.data());
    Store(Load(hessian.data() + 2) + Pair{cross, -along}, hessian.data() + 2);
  };
  add(weight * factor, h_p, bending.hessian_proximal);
  add(-weight * factor, h_d, bending.hessian_distal);
  double* const rows = bending.hessian_cross.data();
  const Pair quarter{weight, -weight};
  const Pair bent = Both(weight) * h_p;
  Store(Load(rows) + quarter * Swapped(across[0]) + Firsts(bent, bent) * d, rows);
  Store(Load(rows + 2) + quarter * Swapped(across[1]) + Seconds(bent, bent) * d, rows + 2);
}

template <bool kBearsTorque>
[[gnu::always_inline]] inline void StraightJoint(BendingLaw law, double stiffness_mJ,
                                                 const Vector3d& proximal_tangent,
                                                 const Frame& proximal_frame,
                                                 const Vector3d& tangent, const Frame& frame,
                                                 [[maybe_unused]] double torque_mJ,
                                                 double& energy_mJ, JointTerms& out,
                                                 [[maybe_unused]] TurnTerms* turn) {
  // ExpandJoint with rest = proximal tangent: e1, e2 are across it, and the triple products
  // become scalar products of the normals.
  const double y = (tangent - proximal_tangent).squaredNorm() / 2;
  const BendingValue v = EvaluateBending(law, y);
  energy_mJ += stiffness_mJ * v.g;
  const double slope = stiffness_mJ * v.slope;
  const double curvature = stiffness_mJ * v.curvature;
  const Pair along = Both(slope * (1 - y));
  Pair proximal = Both(0);
  Pair distal = Both(0);
  Pair cross[2] = {Both(0), Both(0)};
  for (int a = 0; a < 3; ++a) {
    const Pair t = Load(frame.data() + static_cast<std::ptrdiff_t>(2 * a));
    const Pair p = Load(proximal_frame.data() + static_cast<std::ptrdiff_t>(2 * a));
    distal -= t * Both(proximal_tangent[a]);
    proximal -= p * Both(tangent[a]);
    cross[0] += t * Firsts(p, p);
    cross[1] += t * Seconds(p, p);
  }
  Store(Both(slope) * proximal, out.gradient_proximal.data());
  Store(Both(slope) * distal, out.gradient_distal.data());
  const Pair bent_proximal = Both(curvature) * proximal;
  const Pair bent_distal = Both(curvature) * distal;
  const Pair first = {1, 0};
  const Pair second = {0, 1};
  Store(bent_proximal * Firsts(proximal, proximal) + along * first, out.hessian_proximal.data());
  Store(bent_proximal * Seconds(proximal, proximal) + along * second,
        out.hessian_proximal.data() + 2);
  Store(bent_distal * Firsts(distal, distal) + along * first, out.hessian_distal.data());
  Store(bent_distal * Seconds(distal, distal) + along * second, out.hessian_distal.data() + 2);
  Store(bent_distal * Firsts(proximal, proximal) - Both(slope) * cross[0],
        out.hessian_cross.data());
  Store(bent_distal * Seconds(proximal, proximal) - Both(slope) * cross[1],
        out.hessian_cross.data() + 2);
  if constexpr (kBearsTorque)
    AddTorqueTerms(torque_mJ, 1 / (2 - y), -proximal, -distal, cross, out, *turn);
}

}  // namespace

void ExpandStraightJoint(BendingLaw law, double stiffness_mJ, const Vector3d& proximal_tangent,
                         const Frame& proximal_frame, const Vector3d& tangent, const Frame& frame,
                         double& energy_mJ, JointTerms& out) {
  StraightJoint<false>(law, stiffness_mJ, proximal_tangent, proximal_frame, tangent, frame, 0,
                       energy_mJ, out, nullptr);
}

void ExpandStraightJoint(BendingLaw law, double stiffness_mJ, const Vector3d& proximal_tangent,
                         const Frame& proximal_frame, const Vector3d& tangent, const Frame& frame,
                         double torque_mJ, double& energy_mJ, JointTerms& out, TurnTerms& turn) {
  StraightJoint<true>(law, stiffness_mJ, proximal_tangent, proximal_frame, tangent, frame,
                      torque_mJ, energy_mJ, out, &turn);
}

TwistGeometry::TwistGeometry(const Vector3d& proximal_tangent, const Frame& proximal_frame,
                             const Vector3d& tangent, const Frame& frame)
    : h_p(proximal_frame.transpose() * tangent),
      h_d(frame.transpose() * proximal_tangent),
      across(proximal_frame.transpose() * frame),
      factor(1 / (1 + proximal_tangent.dot(tangent))) {
  g_p = factor * Vector2d(-h_p[1], h_p[0]);
  g_d = factor * Vector2d(h_d[1], -h_d[0]);
}

void AddTwistTerms(double stiffness_mJ, double torque_mJ, const TwistGeometry& geometry,
                   JointTerms& bending) {
  const Vector2d& g_p = geometry.g_p;
  const Vector2d& g_d = geometry.g_d;
  bending.gradient_proximal += torque_mJ * g_p;
  bending.gradient_distal += torque_mJ * g_d;
  // Areas of triangles, to second order.
  const double half = torque_mJ * geometry.factor / 2;
  const auto symmetric = [](const Vector2d& a, const Vector2d& b) {
    Matrix2d m;
    m << 2 * a[0] * b[0], a[0] * b[1] + a[1] * b[0], 0, 2 * a[1] * b[1];
    m(1, 0) = m(0, 1);
    return m;
  };
  bending.hessian_proximal +=
      stiffness_mJ * g_p * g_p.transpose() - half * symmetric(g_p, geometry.h_p);
  bending.hessian_distal +=
      stiffness_mJ * g_d * g_d.transpose() - half * symmetric(g_d, geometry.h_d);
  const Matrix2d& across = geometry.across;
  Matrix2d turned;  // the columns of `across`, rotated by a quarter turn
  turned << across(0, 1), -across(0, 0), across(1, 1), -across(1, 0);
  bending.hessian_cross +=
      stiffness_mJ * g_p * g_d.transpose() +
      (torque_mJ * geometry.factor) * (turned - geometry.h_p * g_d.transpose());
}

void AddTwist(double stiffness_mJ, double twist_rad, const Vector3d& proximal_tangent,
              const Frame& proximal_frame, const Vector3d& tangent, const Frame& frame,
              double& energy_mJ, JointTerms& bending, TwistTerms& out) {
  // The twist grows by zeta_d - zeta_p, and by the area that the step sweeps on the sphere of
  // tangents. To first order this area is g_p.xi_p + g_d.xi_d.
  const double k = stiffness_mJ;
  const double torque = k * twist_rad;
  energy_mJ += torque * twist_rad / 2;
  const TwistGeometry geometry(proximal_tangent, proximal_frame, tangent, frame);
  AddTwistTerms(k, torque, geometry, bending);
  out.gradient_proximal = -torque;
  out.gradient_distal = torque;
  out.hessian_proximal = k;
  out.hessian_distal = k;
  out.hessian_cross = -k;
  out.proximal_proximal = -k * geometry.g_p;
  out.proximal_distal = -k * geometry.g_d;
  out.distal_proximal = k * geometry.g_p;
  out.distal_distal = k * geometry.g_d;
  out.distal_displacement.setZero();
}

void AddTorque(double torque_mJ, const Vector3d& proximal_tangent, const Frame& proximal_frame,
               const Vector3d& tangent, const Frame& frame, JointTerms& bending, TurnTerms& turn) {
  Pair h_p = Both(0);
  Pair h_d = Both(0);
  Pair across[2] = {Both(0), Both(0)};
  for (int a = 0; a < 3; ++a) {
    const Pair p = Load(proximal_frame.data() + static_cast<std::ptrdiff_t>(2 * a));
    const Pair d = Load(frame.data() + static_cast<std::ptrdiff_t>(2 * a));
    h_p += p * Both(tangent[a]);
    h_d += d * Both(proximal_tangent[a]);
    across[0] += Firsts(p, p) * d;
    across[1] += Seconds(p, p) * d;
  }
  AddTorqueTerms(torque_mJ, 1 / (1 + proximal_tangent.dot(tangent)), h_p, h_d, across, bending,
                 turn);
}

RestSpinTerms SpinOfRest(BendingLaw law, double stiffness_mJ, const Vector3d& proximal_tangent,
                         const Vector3d& proximal_normal, const Vector3d& rest,
                         const Vector3d& tangent, const Frame& frame) {
  // As in ExpandJoint, with u_p zeta added to the rotation vector of the rest direction.
  const double y = (tangent - rest).squaredNorm() / 2;
  const BendingValue v = EvaluateBending(law, y);
  const double slope = stiffness_mJ * v.slope;
  const double curvature = stiffness_mJ * v.curvature;
  const Vector3d e1 = proximal_tangent.cross(proximal_normal);
  const Vector3d e2 = -proximal_normal;
  const Vector3d moment = rest.cross(tangent);
  const Vector2d y_distal = -frame.transpose() * rest;
  const Vector2d y_proximal(-e1.dot(moment), -e2.dot(moment));
  const double y_spin = -proximal_tangent.dot(moment);
  const double cosine = tangent.dot(proximal_tangent);
  return {
      .gradient = slope * y_spin,
      .hessian =
          curvature * y_spin * y_spin + slope * (1 - y - cosine * proximal_tangent.dot(rest)),
      .with_proximal =
          curvature * y_spin * y_proximal - (slope * cosine) * Vector2d(e1.dot(rest), e2.dot(rest)),
      .with_distal = curvature * y_spin * y_distal -
                     slope * (frame.transpose() * proximal_tangent.cross(rest)),
  };
}

}  // namespace torquer
