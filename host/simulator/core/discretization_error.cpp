#include "host/simulator/core/discretization_error.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "host/simulator/core/bending.h"

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

void DiscretizationDefect::Reserve(int max_segments) {
  const auto room = static_cast<std::size_t>(max_segments) + 2;
  for (auto* vectors : {&moment_mJ_, &law_rad_, &curvature_, &shift_mm_}) vectors->reserve(room);
}

void DiscretizationDefect::FindMoments(const WireModel& model, const Curve& curve) {
  const int n = curve.segments();
  moment_mJ_.resize(n);
  law_rad_.resize(n);
  curvature_.resize(n);
  shift_mm_.resize(n + 1);
  Vector3d before = Vector3d::Zero();
  for (int i = 0; i < n; ++i) {
    const int joint = static_cast<int>(i);
    const Vector3d& u = curve.tangents()[i];
    const Vector3d rest = RestDirection(model, curve, joint);
    const Vector3d across = rest.cross(u);
    const double sine = across.norm();
    const double slope = EvaluateBending(model.law(), (u - rest).squaredNorm() / 2).slope;
    moment_mJ_[i] = JointStiffness(model, curve, joint) * slope * across;
    const double angle = std::atan2(sine, rest.dot(u));
    law_rad_[i] = sine > 0 ? Vector3d((angle / sine - slope) * across) : Vector3d::Zero();
    const Vector3d& previous = i == 0 ? model.sheath().direction : curve.tangents()[i - 1];
    const Vector3d bend = (u - previous) / JointLength(model, curve, joint);
    if (i > 0) curvature_[i - 1] = (before + bend) / 2;
    before = bend;
  }
  if (n > 0) curvature_[n - 1] = before;
  shift_mm_[0].setZero();
  for (int i = 0; i < n; ++i) {
    const double length = curve.SegmentLength(model, static_cast<int>(i));
    const double shorter = curvature_[i].squaredNorm() * length * length / 24;
    shift_mm_[i + 1] = shift_mm_[i] - shorter * length * curve.tangents()[i];
  }
}

// The angle between two chords is a mean of the curvature, weighted by a hat function. The joint
// samples the moment at the node, and its law is that of chords.
Vector3d DiscretizationDefect::MissedBend(const WireModel& model, const Curve& curve,
                                          int joint) const {
  const int n = curve.segments();
  const double lambda = model.segment_mm();
  const double first = curve.first_segment_mm();
  const double rigidity = model.rigidity_N_mm2(n - joint);
  Vector3d bend = law_rad_[joint];
  if (n < 4) return bend;
  // Second derivative at the nearest joint with a segment on either side.
  const int middle = std::clamp(joint, 2, n - 2);
  const Vector3d second =
      (moment_mJ_[middle + 1] - 2 * moment_mJ_[middle] + moment_mJ_[middle - 1]) /
      (rigidity * lambda * lambda);
  if (joint > 1) return bend - lambda * lambda * lambda / 12 * second;
  if (joint == 1) {
    const Vector3d slope =
        (moment_mJ_[2] - moment_mJ_[1]) / (rigidity * lambda) - lambda / 2 * second;
    return bend - (lambda * lambda - first * first) / 6 * slope -
           (lambda * lambda * lambda + first * first * first) / 24 * second;
  }
  const Vector3d slope = (moment_mJ_[1] - moment_mJ_[0]) / (rigidity * first) - first / 2 * second;
  return bend - first * first / 6 * slope - first * first * first / 24 * second;
}

void DiscretizationDefect::ReplaceGradients(const WireModel& model, const Curve& curve,
                                            CurveQuadraticModel& quadratic) {
  FindMoments(model, curve);
  Vector3d change_beyond_N = Vector3d::Zero();
  Vector3d moment_beyond = Vector3d::Zero();
  for (int i = curve.segments() - 1; i >= 0; --i) {
    const double length = curve.SegmentLength(model, i);
    const double shorter = curvature_[i].squaredNorm() * length * length / 24;
    // Loads act on the arc, beside the chord, and on shorter levers.
    Vector3d lever = length * change_beyond_N - shorter * length * quadratic.distal_gradient[i + 1];
    if (quadratic.load_index[i] >= 0) {
      const LoadTerms& load = quadratic.loads[quadratic.load_index[i]];
      const Vector3d along = -shorter * curve.tangents()[i];
      const Vector3d bulge_N = (length * load.h1 - load.h2) * curvature_[i] / 2;
      change_beyond_N += load.h0 * shift_mm_[i] + load.h1 * along - bulge_N;
      lever += load.h1 * shift_mm_[i] + load.h2 * along - length / 2 * bulge_N - shorter * load.g1;
    }
    const Vector3d moment = JointStiffness(model, curve, i) * MissedBend(model, curve, i);
    const Vector3d turn = moment - moment_beyond;
    moment_beyond = moment;
    const Frame& frame = quadratic.frames[i];
    const Vector2d defect =
        frame.transpose() * lever + Vector2d(turn.dot(frame.col(1)), -turn.dot(frame.col(0)));
    quadratic.joints[i].gradient_distal += defect - quadratic.gradient[i];
  }
}

}  // namespace torquer
