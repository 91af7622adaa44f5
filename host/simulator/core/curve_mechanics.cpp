#include "host/simulator/core/curve_mechanics.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "host/simulator/core/pair.h"

namespace torquer {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

void WallSpring::Press(double pressed_N, const ClearanceSample& sample) {
  force_N = pressed_N;
  hessian.noalias() = stiffness_N_mm * sample.gradient * sample.gradient.transpose();
  if (!(pressed_N > 0)) return;
  // Curvature of the wall. It is kept in full if it stiffens the spring or at most halves it. In a
  // deep corner the full curvature would make the whole Hessian indefinite.
  const double bent_N_mm = pressed_N * sample.hessian.norm();
  const double keep = bent_N_mm > 0.5 * stiffness_N_mm ? 0.5 * stiffness_N_mm / bent_N_mm : 1;
  hessian -= (pressed_N * keep) * sample.hessian;
}

CurveMechanics::CurveMechanics(const WireModel& model, const ClearanceField& field,
                               const WallModel& wall, const InstrumentStack* stack, int curve)
    : model_(model),
      wall_(wall),
      sheath_frame_(TangentFrame(model.sheath().direction, model.sheath_normal())),
      points_(model, field, wall, stack, curve) {}

void CurveMechanics::Reserve(bool terms, CurveQuadraticModel& out) const {
  // Extra room: terms that act between points use a few more places than there are points.
  constexpr std::size_t kMostMoments = 16;
  const auto n = static_cast<std::size_t>(model_.max_segments()) + 1;
  const std::size_t points = n * static_cast<std::size_t>(wall_.points_per_segment);
  out.frames.reserve(n);
  out.joints.reserve(n);
  out.load_index.reserve(n);
  out.loads.reserve(n);
  out.distal_gradient.reserve(n + 1);
  out.gradient.reserve(n);
  const int spins = model_.spins();
  if (spins > 0) {
    (model_.twists() ? out.twists.reserve(n) : out.stack.reserve(n));
    out.spin_gradient.reserve(n * spins);
    out.derivatives.on_spins.reserve(terms ? kMostMoments + points : 0);
    if (model_.stack_twists() && terms) {
      out.derivatives.between.reserve(n * spins);
      out.points.between.pressed_N.reserve(n);
    }
  } else if (model_.most_curved_joints() > 1) {
    out.turns.reserve(n);
  }
  points_.Reserve(out.points);
  out.springs.reserve(points);
  out.derivatives.Reserve(points);
  if (terms) out.derivatives.on_tangents.reserve(kMostMoments + points);
}

void CurveMechanics::ExpandWall(bool with_hessian, CurveQuadraticModel& out) const {
  out.springs.clear();
  out.max_penetration_mm = 0;
  out.energy_mJ += out.points.parted_mJ;
  for (const int q : out.points.near) {
    const ClearanceSample& sample = out.points.clearance[q];
    WallSpring& spring = out.springs.emplace_back();
    spring.stiffness_N_mm = out.points.stiffness_N_mm2[q] * out.points.weight_mm[q];
    spring.penetration_mm = out.points.radius_mm[q] - sample.clearance_mm;
    if (out.points.touches[q]) {
      out.max_penetration_mm = std::max(out.max_penetration_mm, spring.penetration_mm);
      out.energy_mJ += spring.stiffness_N_mm * spring.penetration_mm * spring.penetration_mm / 2;
    }
    if (with_hessian) {
      spring.Press(spring.ContactForceN(), sample);
    } else {
      spring.force_N = spring.ContactForceN();
    }
  }
}

void CurveMechanics::ExpandJoints(const Curve& curve, CurveQuadraticModel& out) const {
  const int n = curve.segments();
  const int curved_from =
      n - model_.first_straight_joint() + 1;  // joints from this index on rest curved
  double curved = 0;
  double straight = 0;
  for (int i = 0; i < n; ++i) {
    const Vector3d& tangent_p = i == 0 ? model_.sheath().direction : curve.tangents()[i - 1];
    const double stiffness = JointStiffness(model_, curve, i);
    if (i < curved_from || model_.rest_direction(n - i)[2] == 1) {
      const Frame& frame_p = i == 0 ? sheath_frame_ : out.frames[i - 1];
      ExpandStraightJoint(model_.law(), stiffness, tangent_p, frame_p, curve.tangents()[i],
                          out.frames[i], i < curved_from ? straight : curved, out.joints[i]);
    } else {
      // The normals of the clamp never turn, so any normal will do.
      const Vector3d& normal_p = i == 0 ? model_.sheath_normal() : curve.normals()[i - 1];
      ExpandJoint(model_.law(), stiffness, tangent_p, normal_p, RestDirection(model_, curve, i),
                  curve.tangents()[i], curve.normals()[i], curved, out.joints[i]);
    }
  }
  out.energy_mJ += straight + curved;
}

// Goes from the tip to the sheath. The twisting moment is the sum of the torques of all curved
// joints beyond.
void CurveMechanics::ExpandTurningJoints(const Curve& curve, CurveQuadraticModel& out) const {
  const int n = curve.segments();
  const int curved_from = n - model_.first_straight_joint() + 1;
  out.turns.resize(n);
  double torque = 0;
  for (int i = n - 1; i >= 0; --i) {
    const Vector3d& tangent_p = i == 0 ? model_.sheath().direction : curve.tangents()[i - 1];
    const Frame& frame_p = i == 0 ? sheath_frame_ : out.frames[i - 1];
    const double stiffness = JointStiffness(model_, curve, i);
    TurnTerms& turn = out.turns[i];
    turn.rest = RestSpinTerms();
    if (i < curved_from || model_.rest_direction(n - i)[2] == 1) {
      ExpandStraightJoint(model_.law(), stiffness, tangent_p, frame_p, curve.tangents()[i],
                          out.frames[i], torque, out.energy_mJ, out.joints[i], turn);
      continue;
    }
    const Vector3d& normal_p = i == 0 ? model_.sheath_normal() : curve.normals()[i - 1];
    const Vector3d rest = RestDirection(model_, curve, i);
    ExpandJoint(model_.law(), stiffness, tangent_p, normal_p, rest, curve.tangents()[i],
                curve.normals()[i], out.energy_mJ, out.joints[i]);
    AddTorque(torque, tangent_p, frame_p, curve.tangents()[i], out.frames[i], out.joints[i], turn);
    if (i == 0) continue;  // the sheath does not turn
    turn.rest = SpinOfRest(model_.law(), stiffness, tangent_p, normal_p, rest, curve.tangents()[i],
                           out.frames[i]);
    torque -= turn.rest.gradient;
  }
}

void CurveMechanics::ExpandTwists(const Curve& curve, CurveQuadraticModel& out) const {
  const int n = curve.segments();
  out.twists.resize(n);
  for (int i = 0; i < n; ++i) {
    const Vector3d& tangent_p = i == 0 ? model_.sheath().direction : curve.tangents()[i - 1];
    const Frame& frame_p = i == 0 ? sheath_frame_ : out.frames[i - 1];
    AddTwist(TwistStiffness(model_, curve, i), curve.twist_rad()[i], tangent_p, frame_p,
             curve.tangents()[i], out.frames[i], out.energy_mJ, out.joints[i], out.twists[i]);
  }
  for (int i = std::max(1, n - model_.first_straight_joint() + 1); i < n; ++i) {
    const RestSpinTerms rest =
        SpinOfRest(model_.law(), JointStiffness(model_, curve, i), curve.tangents()[i - 1],
                   curve.normals()[i - 1], RestDirection(model_, curve, i), curve.tangents()[i],
                   out.frames[i]);
    TwistTerms& twist = out.twists[i];
    twist.gradient_proximal += rest.gradient;
    twist.hessian_proximal += rest.hessian;
    twist.proximal_proximal += rest.with_proximal;
    twist.proximal_distal += rest.with_distal;
  }
}

void CurveMechanics::ExpandStack(const Curve& curve, CurveQuadraticModel& out) const {
  const int n = curve.segments();
  out.stack.resize(n);
  for (int i = 0; i < n; ++i) {
    ExpandStackJoint(model_, curve, i, i == 0 ? sheath_frame_ : out.frames[i - 1], out.frames[i],
                     out.energy_mJ, out.joints[i], out.stack[i]);
  }
}

void CurveMechanics::AddSpinLoads(const Curve& curve, CurveQuadraticModel& out) const {
  const int per_segment = out.points.per_segment;
  for (const SpinLoad& on : out.derivatives.on_spins) {
    const int i = on.point / per_segment;
    const double t =
        curve.SegmentLength(model_, i) * (on.point % per_segment + 1) / per_segment - on.before_mm;
    const Vector2d with_step = t * (out.frames[i].transpose() * on.with_position);
    if (!model_.twists()) {
      const int k = on.instrument - model_.first_spin();
      StackTerms& stack = out.stack[i];
      stack.gradient_distal[k] += on.gradient;
      stack.hessian_distal(k, k) += on.hessian;
      stack.distal_displacement.row(k) += on.with_position.transpose();
      stack.distal_distal.row(k) += with_step.transpose();
      continue;
    }
    TwistTerms& twist = out.twists[i];
    twist.gradient_distal += on.gradient;
    twist.hessian_distal += on.hessian;
    twist.distal_displacement += on.with_position;
    twist.distal_distal += with_step;
  }
  for (const BetweenLoad& on : out.derivatives.between) {
    const int a = on.inner - model_.first_spin();
    const int b = on.outer - model_.first_spin();
    StackTerms& stack = out.stack[on.segment];
    stack.gradient_distal[a] += on.gradient;
    stack.gradient_distal[b] -= on.gradient;
    stack.hessian_distal(a, a) += on.hessian;
    stack.hessian_distal(b, b) += on.hessian;
    stack.hessian_distal(a, b) -= on.hessian;
    stack.hessian_distal(b, a) -= on.hessian;
  }
}

LoadTerms& CurveMechanics::LoadsOf(int segment, CurveQuadraticModel& out) {
  if (out.load_index[segment] < 0) {
    out.load_index[segment] = static_cast<int>(out.loads.size());
    out.loads.push_back({Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero(),
                         Matrix3d::Zero(), Matrix3d::Zero(), Matrix3d::Zero()});
  }
  return out.loads[out.load_index[segment]];
}

void CurveMechanics::AddLoad(int point, double length_mm, const Vector3d& gradient,
                             const Vector3d& force_N, const Matrix3d* hessian,
                             CurveQuadraticModel& out) {
  LoadTerms& load = LoadsOf(point / out.points.per_segment, out);
  const double t = length_mm * (point % out.points.per_segment + 1) / out.points.per_segment;
  load.g0 += gradient;
  load.g1 += t * gradient;
  load.f0 += force_N;
  load.f1 += t * force_N;
  if (hessian == nullptr) return;
  load.h0 += *hessian;
  load.h1 += t * *hessian;
  load.h2 += (t * t) * *hessian;
}

// Sets the gradient by the spins of a segment. Returns the largest squared value over the local
// GJ/(1 mm).
double CurveMechanics::SumSpins(const Curve& curve, int segment, CurveQuadraticModel& out) const {
  const int n = curve.segments();
  const auto take = [&](std::size_t at, double spin, double before, double beyond) {
    out.spin_gradient[at] = spin;
    const double torsional = std::min(before, beyond);
    return spin * spin / (torsional * torsional);
  };
  const bool last = segment + 1 == n;
  if (model_.twists()) {
    return take(segment,
                out.twists[segment].gradient_distal +
                    (last ? 0 : out.twists[segment + 1].gradient_proximal),
                model_.torsional_rigidity_N_mm2(n - segment),
                model_.torsional_rigidity_N_mm2(n - segment - 1));
  }
  const int count = model_.spins();
  const auto first = static_cast<std::size_t>(model_.first_spin());
  double largest = 0;
  for (int k = 0; k < count; ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    const double spin = out.stack[segment].gradient_distal[row] +
                        (last ? 0 : out.stack[segment + 1].gradient_proximal[row]);
    largest = std::max(
        largest,
        take(segment * count + k, spin,
             model_.twisting_joint(n - segment).of[first + k].torsional_rigidity_N_mm2,
             model_.twisting_joint(n - segment - 1).of[first + k].torsional_rigidity_N_mm2));
  }
  return largest;
}

double CurveMechanics::SumGradient(const Curve& curve, CurveQuadraticModel& out) const {
  const bool touches = !out.touch_gradient.empty();
  const int n = curve.segments();
  double residual = 0;
  Vector3d beyond = Vector3d::Zero();
  out.distal_gradient[n] = beyond;
  for (int i = n - 1; i >= 0; --i) {
    if (touches) beyond += out.touch_gradient[i].head<3>();
    Vector3d lever = curve.SegmentLength(model_, i) * beyond;
    const int at = out.load_index[i];
    if (at >= 0) {
      lever += out.loads[at].g1;
      beyond += out.loads[at].g0;
    }
    out.distal_gradient[i] = beyond;
    const double* frame = out.frames[i].data();
    Pair g = Load(frame) * Both(lever[0]) + Load(frame + 2) * Both(lever[1]) +
             Load(frame + 4) * Both(lever[2]) + Load(out.joints[i].gradient_distal.data());
    if (i + 1 < n) g += Load(out.joints[i + 1].gradient_proximal.data());
    if (touches) {
      const Vector2d pressed = out.touch_gradient[i].tail<2>();
      g += Load(pressed.data());
    }
    Store(g, out.gradient[i].data());
    // Uses the softer of the segment's two joints: an out-of-balance moment bends it most.
    const double rigidity =
        std::min(model_.rigidity_N_mm2(n - i), model_.rigidity_N_mm2(n - i - 1));
    residual = std::max(residual, Summed(g * g)[0] / (rigidity * rigidity));
    if (model_.spins() > 0) residual = std::max(residual, SumSpins(curve, i, out));
  }
  return std::sqrt(residual);
}

void CurveMechanics::PrepareSegments(const Curve& curve, CurveQuadraticModel& out) const {
  const int n = curve.segments();
  out.frames.resize(n);
  for (int i = 0; i < n; ++i) out.frames[i] = TangentFrame(curve.tangents()[i], curve.normals()[i]);
  out.joints.resize(n);
  out.load_index.resize(n);
  out.distal_gradient.resize(n + 1);
  out.gradient.resize(n);
}

void CurveMechanics::ExpandBending(const Curve& curve, CurveQuadraticModel& out) const {
  out.turns.clear();
  if (model_.stack_twists()) {
    ExpandStack(curve, out);
  } else if (!model_.twists() && model_.first_straight_joint() > 1) {
    ExpandTurningJoints(curve, out);
  } else {
    ExpandJoints(curve, out);
  }
}

void CurveMechanics::BuildModel(const Curve& curve, double in_lumen_mm, bool with_hessian,
                                CurveQuadraticModel& out) {
  PrepareSegments(curve, out);
  out.energy_mJ = 0;
  points_.Place(curve, in_lumen_mm, with_hessian, out.points);
  out.derivatives.with_hessian = with_hessian;
  ExpandWall(with_hessian, out);
  ExpandBending(curve, out);
  out.spin_gradient.resize(static_cast<std::size_t>(curve.segments()) *
                           static_cast<std::size_t>(model_.spins()));
  if (model_.twists()) ExpandTwists(curve, out);
}

void CurveMechanics::SumTrueGradient(const Curve& curve, CurveQuadraticModel& out) const {
  SumLoads(
      curve, [&out](std::size_t k) { return out.springs[k].penetration_mm > 0; }, out);
  out.residual = SumGradient(curve, out);
}

}  // namespace torquer
