#include "host/simulator/core/newton/riccati_sweep.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace torquer {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix32d = Eigen::Matrix<double, 3, 2>;
using Matrix23d = Eigen::Matrix<double, 2, 3>;

RiccatiSweep<BendStage>::RiccatiSweep(int max_segments) {
  gains_.reserve(static_cast<std::size_t>(max_segments) + 1);
}

bool RiccatiSweep<BendStage>::Factor(const WireModel& model, const WireState& state,
                                     const Expansion& expansion, double proximal) {
  const int n = state.segments();
  gains_.resize(static_cast<std::size_t>(n));
  Matrix3d p_xx = Matrix3d::Zero();
  Matrix32d p_xc = Matrix32d::Zero();
  Matrix2d p_cc = Matrix2d::Zero();
  Vector3d g_x = Vector3d::Zero();
  Vector2d g_c = Vector2d::Zero();
  double predicted = 0;
  for (int i = n - 1; i >= 0; --i) {
    const JointTerms& joint = expansion.joints[i];
    const double length = state.SegmentLength(model, i);
    const Vector3d& tangent = state.tangents[i];
    Matrix32d plane;
    plane.col(0) = state.normals[i];
    plane.col(1) = tangent.cross(state.normals[i]);

    // Beyond node i + 1: dx_{i+1} = dx_i + length * plane * xi - length |xi|^2/2 tangent.
    const Matrix32d p_plane = p_xx * plane;
    Matrix32d f_x = length * p_plane + p_xc;
    Matrix2d pivot =
        (length * length) * (plane.transpose() * p_plane) + p_cc + joint.hessian_distal;
    const Matrix2d mixed = length * (plane.transpose() * p_xc);
    pivot += mixed + mixed.transpose();
    Vector2d f = length * (plane.transpose() * g_x) + g_c + joint.gradient_distal;
    double along = length * expansion.costate[static_cast<std::size_t>(i) + 1].dot(tangent);

    // Loads on the segment itself.
    const int at = expansion.load_index[i];
    if (at >= 0) {
      const LoadTerms& load = expansion.loads[at];
      f_x += load.h1 * plane;
      pivot += plane.transpose() * load.h2 * plane;
      f += plane.transpose() * load.g1;
      along += load.g1.dot(tangent);
      p_xx += load.h0;
      g_x += load.g0;
    }
    const double rigidity = std::min(model.rigidity_N_mm2(n - i), model.rigidity_N_mm2(n - i - 1));
    pivot.diagonal().array() += proximal * rigidity - along;

    const double determinant = pivot(0, 0) * pivot(1, 1) - pivot(0, 1) * pivot(0, 1);
    // Relative, so that a pivot that is zero but for rounding does not pass.
    if (!(pivot(0, 0) > 0) || !(determinant > 1e-12 * pivot(0, 0) * pivot(1, 1))) return false;
    Matrix2d inverse;
    inverse << pivot(1, 1), -pivot(0, 1), -pivot(0, 1), pivot(0, 0);
    inverse /= determinant;

    Gain& gain = gains_[i];
    gain.of_displacement = inverse * f_x.transpose();
    gain.of_previous = inverse * joint.hessian_cross.transpose();
    gain.constant = inverse * f;
    predicted += f.dot(gain.constant) / 2;

    p_xx -= f_x * gain.of_displacement;
    p_xc = -(f_x * gain.of_previous);
    p_cc = joint.hessian_proximal - joint.hessian_cross * gain.of_previous;
    g_x -= f_x * gain.constant;
    g_c = joint.gradient_proximal - joint.hessian_cross * gain.constant;
  }
  predicted_decrease_ = predicted;
  return true;
}

double RiccatiSweep<BendStage>::Step(const WireModel& model, const WireState& state,
                                     std::vector<Control>& step) const {
  const int n = state.segments();
  step.resize(static_cast<std::size_t>(n));
  Vector3d displacement = Vector3d::Zero();
  Vector2d previous = Vector2d::Zero();
  for (int i = 0; i < n; ++i) {
    const Gain& gain = gains_[i];
    previous = -(gain.constant + gain.of_displacement * displacement + gain.of_previous * previous);
    step[i] = previous;
    const Vector3d& normal = state.normals[i];
    displacement += state.SegmentLength(model, i) *
                    (previous[0] * normal + previous[1] * state.tangents[i].cross(normal));
  }
  return predicted_decrease_;
}

}  // namespace torquer
