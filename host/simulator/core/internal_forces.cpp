#include "host/simulator/core/internal_forces.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "host/simulator/core/stack/stack_terms.h"

namespace torquer {

using Eigen::Vector3d;

namespace {

// Bending moment at joint i, of its distal on its proximal side (README section 15).
Vector3d BendingMoment(const WireModel& model, const Curve& curve, int joint) {
  const Vector3d rest = RestDirection(model, curve, joint);
  const Vector3d& tangent = curve.tangents()[joint];
  const double slope = EvaluateBending(model.law(), (tangent - rest).squaredNorm() / 2).slope;
  return JointStiffness(model, curve, joint) * slope * rest.cross(tangent);
}

void FindFriction(const PointSet& points, const std::vector<EnergyTerm*>& terms,
                  PointDerivatives& out) {
  const int size = points.size();
  out.with_hessian = false;
  out.Clear(size);
  out.gradient.assign(size, Vector3d::Zero());
  out.used.assign(size, PointDerivatives::kGradient);
  for (EnergyTerm* term : terms) {
    const ContactTerm* contact = term->contact_term();
    if (contact != nullptr && contact->ActsOnWall()) term->Add(points, out);
  }
}

// Torque of surface friction: the surface touches the wall a radius away from the axis, against the
// wall's normal. Friction between points is shared by them; it takes the normal of the point near
// the wall.
void FindSurfaceTorques(const PointSet& points, const PointDerivatives& friction,
                        std::vector<double>& out) {
  int done = -1;
  const auto take = [&](int q, int near) {
    if (q <= done || q >= points.size()) return;
    done = q;
    const Vector3d& gradient_N = friction.gradient[q];
    if (gradient_N == Vector3d::Zero()) return;
    const Vector3d normal = points.clearance[near].gradient.normalized();
    out[q] = points.radius_mm[q] * normal.cross(gradient_N).dot(points.Tangent(q));
  };
  for (std::size_t k = 0; k < points.near.size(); ++k) {
    const int q = points.near[k];
    const bool next_is_near = k + 1 < points.near.size() && points.near[k + 1] == q + 1;
    take(q - 1, q);
    take(q, q);
    if (!next_is_near) take(q + 1, q);
  }
}

// Nodes before and after a place of a curve, and the share of the latter by the lever rule. This
// keeps force and moment.
struct Lever {
  std::size_t node;
  double fraction;
};

// Lever of point q of `points` on the nodes of the curve with `own` points. On another curve,
// places at the same way from the sheath correspond.
Lever LeverOf(const PointSet& own, const PointSet& points, int q) {
  const auto per_segment = static_cast<double>(own.per_segment);
  if (&own == &points) {
    return {static_cast<std::size_t>(q / own.per_segment), (q % own.per_segment + 1) / per_segment};
  }
  const double first_mm = own.first_spacing_mm * per_segment;
  const double lambda_mm = own.spacing_mm * per_segment;
  const double arc_mm = points.FromTipMm(0) + points.first_spacing_mm - points.FromTipMm(q);
  if (arc_mm <= first_mm) return {0, arc_mm / first_mm};
  const double past = (arc_mm - first_mm) / lambda_mm;
  const int segment = std::min(static_cast<int>(past) + 1, own.segments() - 1);
  return {static_cast<std::size_t>(segment), std::min(past - (segment - 1), 1.0)};
}

// Adds the forces of the wall on a curve to the nodes of the curve with `own` points.
void AddContacts(const PointSet& own, const CurveQuadraticModel& at,
                 std::vector<Vector3d>& force_N) {
  for (std::size_t k = 0; k < at.springs.size(); ++k) {
    const WallSpring& spring = at.springs[k];
    if (!(spring.penetration_mm > 0)) continue;
    const int q = at.points.near[k];
    const Vector3d normal_N =
        spring.stiffness_N_mm * spring.penetration_mm * at.points.clearance[q].gradient;
    const Lever lever = LeverOf(own, at.points, q);
    force_N[lever.node] += (1 - lever.fraction) * normal_N;
    force_N[lever.node + 1] += lever.fraction * normal_N;
  }
}

void FindContacts(const QuadraticModel& at, int curve, InternalForces& out) {
  const PointSet& own = at.curve(curve).points;
  std::vector<Vector3d>& force = out.contact_N;
  std::vector<double>& length_mm = out.tension_N;  // a temporary buffer: filled with tensions later
  std::fill(length_mm.begin(), length_mm.end(), 0);
  for (int q = 0; q < own.size(); ++q) {
    const Lever lever = LeverOf(own, own, q);
    const double weight_mm = own.weight_mm[q];
    length_mm[lever.node] += (1 - lever.fraction) * weight_mm;
    length_mm[lever.node + 1] += lever.fraction * weight_mm;
  }
  const int curves = 1 + static_cast<int>(at.around.size());
  // The wall presses a wire beside this one at another place.
  for (int c = 0; c < curves; ++c) {
    if (!at.curve(c).points.among.beside_farthest) AddContacts(own, at.curve(c), force);
  }
  for (std::size_t i = 0; i < force.size(); ++i) {
    out.line_load_N_mm[i] = length_mm[i] > 0 ? force[i].norm() / length_mm[i] : 0;
  }
  for (int c = 0; c < curves; ++c) {
    const PointSet& points = at.curve(c).points;
    if (points.among.beside_farthest) continue;
    for (int q = 0; q < points.size(); ++q) {
      const Vector3d& gradient_N = out.friction[c].gradient[q];
      const Lever lever = LeverOf(own, points, q);
      force[lever.node] -= (1 - lever.fraction) * gradient_N;
      force[lever.node + 1] -= lever.fraction * gradient_N;
    }
  }
}

void FindTension(const WireModel& model, const Curve& curve, const CurveQuadraticModel& at,
                 InternalForces& out) {
  const int n = curve.segments();
  const auto per_segment = static_cast<std::size_t>(at.points.per_segment);
  const std::vector<Vector3d>& tangents = curve.tangents();
  out.tension_N[0] = -at.distal_gradient[0].dot(model.sheath().direction);
  for (int i = 1; i <= n; ++i) {
    // The load at the node itself counts half on either side; at the end it counts in full.
    const Vector3d& at_node = out.loads.point_gradient_N[per_segment * i - 1];
    out.tension_N[i] = i == n ? -at_node.dot(tangents[i - 1])
                              : -(at.distal_gradient[i] + at_node / 2)
                                     .dot((tangents[i - 1] + tangents[i]).normalized());
  }
}

// Twisting moment at joint i of a wire that twists: the sum over all instruments.
double TwistingMoment(const WireModel& model, const Curve& curve, int joint) {
  double torque = 0;
  for (int k = 0; k < model.spins(); ++k) {
    torque += TwistStiffnessOf(model, curve, joint, k) * curve.TwistOf(joint, k);
  }
  return torque;
}

// Torque of lumen friction on the surfaces of a curve, summed by segment.
void FindLumenTorques(const QuadraticModel& at, int curve, std::vector<double>& out) {
  for (const BetweenCurves& between : at.between) {
    for (const BetweenCurves::Slide& slide : between.slides) {
      const SegmentPair& on = between.groups[slide.group];
      if (between.inner == curve) {
        out[on.inner] -= slide.inner_spin_mm.dot(slide.load.gradient);
      }
      if (between.outer == curve) {
        out[on.outer] -= slide.outer_spin_mm.dot(slide.load.gradient);
      }
    }
  }
}

void FindMoments(const WireModel& model, const WireState& state, const QuadraticModel& all,
                 InternalForces& out) {
  const int number = state.FarthestCurve();
  const Curve& curve = state.curve(number);
  const CurveQuadraticModel& at = all.curve(number);
  const int n = curve.segments();
  const bool twists = model.spins() > 0;
  const int per_segment = at.points.per_segment;
  Vector3d end = Vector3d::Zero();
  for (const TangentLoad& on : at.derivatives.on_tangents) {
    if (on.segment == n - 1) end += on.gradient.cross(curve.tangents().back());
  }
  out.bending_mJ[n] = end.norm();
  double torque = 0;
  double surface = 0;
  if (!twists) FindLumenTorques(all, number, out.twisting_mJ);
  for (int i = n - 1; i >= 0; --i) {
    const Vector3d moment = BendingMoment(model, curve, i);
    const Vector3d& before = i == 0 ? model.sheath().direction : curve.tangents()[i - 1];
    out.bending_mJ[i] = moment.norm();
    // A wire that does not twist transmits the torques on its bent tip and on its surface.
    const double own = moment.dot(before);
    for (int q = per_segment * i; q < per_segment * (i + 1); ++q) {
      surface += out.surface_torque_mJ[number][q];
    }
    surface += out.twisting_mJ[i];
    torque = twists ? TwistingMoment(model, curve, i) : torque + own;
    out.twisting_mJ[i] = torque + surface;
    if (i > 0) continue;
    const Vector3d& after = curve.tangents().front();
    out.clamp_moment_mJ = -moment;
    // A torque acts about the mean of both tangents. The joint's own part is in its moment.
    const double carried = twists ? torque : torque - own;
    out.clamp_moment_mJ -= carried / (1 + before.dot(after)) * (before + after);
  }
  if (twists) out.twisting_mJ[n] = out.twisting_mJ.end()[-2];
}

// Adds the contact forces between two curves to the forces on one of them.
void AddBetween(const WireState& state, const BetweenCurves& between, bool inner, CurveLoads& out) {
  const Eigen::Index first = inner ? 0 : 5;
  const std::vector<Vector3d>& inward = state.curve(between.inner).tangents();
  const auto add = [&](const auto& place, const Vector3d& force_N, bool presses) {
    const SegmentPair& on = between.groups[place.group];
    const bool unfelt = presses && between.at_mouth;
    out.in_lumen.push_back({.segment = inner ? on.inner : on.outer,
                            .past_mm = inner ? place.past_mm : place.foot_mm,
                            .in_own_lumen = !inner && !between.beside,
                            .force_N = force_N,
                            .unfelt_N = unfelt ? force_N.dot(inward[on.inner]) : 0});
  };
  for (const BetweenCurves::Spring& spring : between.springs) {
    if (!(spring.penetration_mm > 0)) continue;
    add(spring, -spring.stiffness_N_mm * spring.penetration_mm * spring.approach.segment<3>(first),
        true);
  }
  for (const BetweenCurves::Slide& slide : between.slides) {
    add(slide,
        -slide.load.gradient[0] * slide.along.segment<3>(first) -
            slide.load.gradient[1] * slide.around.segment<3>(first),
        false);
  }
}

}  // namespace

void FindCurveLoads(const WireState& state, const QuadraticModel& quadratic, int curve,
                    CurveLoads& out) {
  const CurveQuadraticModel& at = quadratic.curve(curve);
  const PointSet& points = at.points;
  out.point_gradient_N.assign(points.size(), Vector3d::Zero());
  for (std::size_t q = 0; q < at.derivatives.used.size(); ++q) {
    if (at.derivatives.used[q] == PointDerivatives::kNothing) continue;
    out.point_gradient_N[q] += at.derivatives.gradient[q];
  }
  for (std::size_t k = 0; k < at.springs.size(); ++k) {
    const WallSpring& spring = at.springs[k];
    if (!(spring.penetration_mm > 0)) continue;
    const int p = points.near[k];
    out.point_gradient_N[p] -=
        spring.stiffness_N_mm * spring.penetration_mm * points.clearance[p].gradient;
  }
  out.in_lumen.clear();
  for (const BetweenCurves& between : quadratic.between) {
    // A curve that touches itself is both.
    if (between.inner == curve) AddBetween(state, between, true, out);
    if (between.outer == curve) AddBetween(state, between, false, out);
  }
}

void FindInternalForces(const WireModel& model, const WireState& state,
                        const QuadraticModel& quadratic, const std::vector<EnergyTerm*>& terms,
                        InternalForces& out) {
  const int number = state.FarthestCurve();
  const Curve& curve = state.curve(number);
  const int n = curve.segments();
  const auto nodes = static_cast<std::size_t>(n) + 1;
  out.contact_N.assign(nodes, Vector3d::Zero());
  out.line_load_N_mm.assign(nodes, 0);
  out.tension_N.assign(nodes, 0);
  out.bending_mJ.assign(nodes, 0);
  out.twisting_mJ.assign(nodes, 0);
  out.clamp_force_N.setZero();
  out.clamp_moment_mJ.setZero();
  if (n == 0) return;
  const int curves = state.curves();
  out.friction.resize(curves);
  out.surface_torque_mJ.resize(curves);
  for (int c = 0; c < curves; ++c) {
    const PointSet& points = quadratic.curve(static_cast<int>(c)).points;
    FindFriction(points, terms, out.friction[c]);
    out.surface_torque_mJ[c].assign(points.position.size(), 0);
    if (model.spins() == 0) FindSurfaceTorques(points, out.friction[c], out.surface_torque_mJ[c]);
  }
  FindContacts(quadratic, number, out);
  FindCurveLoads(state, quadratic, number, out.loads);
  FindTension(model, curve, quadratic.curve(number), out);
  FindMoments(model, state, quadratic, out);
  out.clamp_force_N = quadratic.curve(number).distal_gradient[0];
}

}  // namespace torquer
