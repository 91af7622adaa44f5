#include "host/simulator/core/newton/riccati_sweep.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace torquer {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

RiccatiSweep<BendStage>::RiccatiSweep(int max_segments) {
  gains_.reserve(static_cast<std::size_t>(max_segments) + 1);
}

// Written out in scalars: the same with small matrices takes three times as long, and this loop is
// a third of an iteration.
bool RiccatiSweep<BendStage>::Factor(const WireModel& model, const WireState& state,
                                     const Expansion& expansion, double proximal) {
  const int n = state.segments();
  gains_.resize(static_cast<std::size_t>(n));
  Matrix3d p = Matrix3d::Zero();   // P
  Vector3d q1 = Vector3d::Zero();  // columns of Q
  Vector3d q2 = Vector3d::Zero();
  double r11 = 0;  // R
  double r12 = 0;
  double r22 = 0;
  Vector3d g_x = Vector3d::Zero();  // p
  double g1 = 0;                    // q
  double g2 = 0;
  double predicted = 0;
  for (int i = n - 1; i >= 0; --i) {
    const JointTerms& joint = expansion.joints[i];
    const double length = state.SegmentLength(model, i);
    const Vector3d& tangent = state.tangents[i];
    const Vector3d& t1 = state.normals[i];
    const Vector3d& t2 = expansion.seconds[i];

    // Beyond node i + 1: dx_{i+1} = dx_i + length (t1 xi_1 + t2 xi_2) - length |xi|^2/2 tangent.
    const Vector3d p1 = length * (p * t1);
    const Vector3d p2 = length * (p * t2);
    Vector3d f1 = p1 + q1;
    Vector3d f2 = p2 + q2;
    double s11 = length * t1.dot(p1 + 2 * q1) + r11 + joint.hessian_distal(0, 0);
    double s12 = length * (t1.dot(f2) + t2.dot(q1)) + r12 + joint.hessian_distal(0, 1);
    double s22 = length * t2.dot(p2 + 2 * q2) + r22 + joint.hessian_distal(1, 1);
    double c1 = length * t1.dot(g_x) + g1 + joint.gradient_distal[0];
    double c2 = length * t2.dot(g_x) + g2 + joint.gradient_distal[1];
    double along = length * expansion.costate[static_cast<std::size_t>(i) + 1].dot(tangent);

    // Loads on the segment itself.
    const int at = expansion.load_index[i];
    if (at >= 0) {
      const LoadTerms& load = expansion.loads[at];
      f1 += load.h1 * t1;
      f2 += load.h1 * t2;
      const Vector3d h2_t1 = load.h2 * t1;
      const Vector3d h2_t2 = load.h2 * t2;
      s11 += t1.dot(h2_t1);
      s12 += t1.dot(h2_t2);
      s22 += t2.dot(h2_t2);
      c1 += t1.dot(load.g1);
      c2 += t2.dot(load.g1);
      along += load.g1.dot(tangent);
      p += load.h0;
      g_x += load.g0;
    }
    const double rigidity = std::min(model.rigidity_N_mm2(n - i), model.rigidity_N_mm2(n - i - 1));
    s11 += proximal * rigidity - along;
    s22 += proximal * rigidity - along;

    const double determinant = s11 * s22 - s12 * s12;
    // Relative, so that a pivot that is zero but for rounding does not pass.
    if (!(s11 > 0) || !(determinant > 1e-12 * s11 * s22)) return false;
    const double scale = 1 / determinant;
    const double i11 = scale * s22;
    const double i12 = -scale * s12;
    const double i22 = scale * s11;

    Gain& gain = gains_[i];
    gain.of_displacement1 = i11 * f1 + i12 * f2;
    gain.of_displacement2 = i12 * f1 + i22 * f2;
    const Matrix2d& m = joint.hessian_cross;
    gain.of_previous << i11 * m(0, 0) + i12 * m(0, 1), i11 * m(1, 0) + i12 * m(1, 1),
        i12 * m(0, 0) + i22 * m(0, 1), i12 * m(1, 0) + i22 * m(1, 1);
    gain.constant << i11 * c1 + i12 * c2, i12 * c1 + i22 * c2;
    predicted += (c1 * gain.constant[0] + c2 * gain.constant[1]) / 2;

    const Matrix2d& l = gain.of_previous;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b <= a; ++b) {
        p(a, b) -= f1[a] * gain.of_displacement1[b] + f2[a] * gain.of_displacement2[b];
        p(b, a) = p(a, b);
      }
    }
    q1 = -(l(0, 0) * f1 + l(1, 0) * f2);
    q2 = -(l(0, 1) * f1 + l(1, 1) * f2);
    const Matrix2d& hp = joint.hessian_proximal;
    r11 = hp(0, 0) - (m(0, 0) * l(0, 0) + m(0, 1) * l(1, 0));
    r12 = hp(0, 1) - (m(0, 0) * l(0, 1) + m(0, 1) * l(1, 1));
    r22 = hp(1, 1) - (m(1, 0) * l(0, 1) + m(1, 1) * l(1, 1));
    g_x -= gain.constant[0] * f1 + gain.constant[1] * f2;
    g1 = joint.gradient_proximal[0] - (m(0, 0) * gain.constant[0] + m(0, 1) * gain.constant[1]);
    g2 = joint.gradient_proximal[1] - (m(1, 0) * gain.constant[0] + m(1, 1) * gain.constant[1]);
  }
  predicted_decrease_ = predicted;
  return true;
}

double RiccatiSweep<BendStage>::Step(const WireModel& model, const WireState& state,
                                     const Expansion& expansion, std::vector<Control>& step,
                                     std::vector<Vector3d>& displacement_mm) const {
  const int n = state.segments();
  step.resize(static_cast<std::size_t>(n));
  displacement_mm.resize(static_cast<std::size_t>(n));
  Vector3d displacement = Vector3d::Zero();
  double xi1 = 0;
  double xi2 = 0;
  for (int i = 0; i < n; ++i) {
    const Gain& gain = gains_[i];
    const Matrix2d& l = gain.of_previous;
    const double next1 = -(gain.constant[0] + gain.of_displacement1.dot(displacement) +
                           l(0, 0) * xi1 + l(0, 1) * xi2);
    const double next2 = -(gain.constant[1] + gain.of_displacement2.dot(displacement) +
                           l(1, 0) * xi1 + l(1, 1) * xi2);
    xi1 = next1;
    xi2 = next2;
    step[i] << xi1, xi2;
    displacement_mm[i] = displacement;
    const double length = state.SegmentLength(model, i);
    displacement += (length * xi1) * state.normals[i] + (length * xi2) * expansion.seconds[i];
  }
  return predicted_decrease_;
}

}  // namespace torquer
