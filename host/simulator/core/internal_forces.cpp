#include "host/simulator/core/internal_forces.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "host/simulator/core/stack/stack_terms.h"

namespace torquer {

using Eigen::Vector3d;

namespace {

// Bending moment at joint i, of its distal on its proximal side (README section 15).
Vector3d BendingMoment(const WireModel& model, const WireState& state, int joint) {
  const auto i = static_cast<std::size_t>(joint);
  const Vector3d rest = RestDirection(model, state, joint);
  const Vector3d& tangent = state.tangents()[i];
  const double slope = EvaluateBending(model.law(), (tangent - rest).squaredNorm() / 2).slope;
  return JointStiffness(model, state, joint) * slope * rest.cross(tangent);
}

void FindFriction(const PointSet& points, const std::vector<EnergyTerm*>& terms,
                  PointDerivatives& out) {
  const auto size = static_cast<std::size_t>(points.size());
  out.with_hessian = false;
  out.gradient.assign(size, Vector3d::Zero());
  out.used.assign(size, PositionDerivatives::kGradient);
  out.covered.with_hessian = false;
  out.hessian.resize(size);
  out.on_tangents.clear();
  out.on_spins.clear();
  out.between.clear();
  out.in_lumen.clear();
  for (const EnergyTerm* term : terms) {
    if (term->ActsOnSurface()) term->Add(points, out);
  }
}

// Torque of surface friction: the surface touches the wall a radius away from the axis, against the
// wall's normal. Friction between points is shared by them; it takes the normal of the point near
// the wall.
void FindSurfaceTorques(const PointSet& points, InternalForces& out) {
  int done = -1;
  const auto take = [&](int q, int near) {
    if (q <= done || q >= points.size()) return;
    done = q;
    const auto p = static_cast<std::size_t>(q);
    const Vector3d& gradient_N = out.friction.gradient[p];
    if (gradient_N == Vector3d::Zero()) return;
    const Vector3d normal = points.clearance[static_cast<std::size_t>(near)].gradient.normalized();
    out.surface_torque_mJ[p] =
        points.radius_mm[p] * normal.cross(gradient_N).dot(points.Tangent(q));
  };
  for (std::size_t k = 0; k < points.near.size(); ++k) {
    const int q = points.near[k];
    const bool next_is_near = k + 1 < points.near.size() && points.near[k + 1] == q + 1;
    take(q - 1, q);
    take(q, q);
    if (!next_is_near) take(q + 1, q);
  }
}

// Shares the loads on the points between the nodes before and after each, by the lever rule. This
// keeps force and moment.
void FindContacts(const Expansion& at, InternalForces& out) {
  const PointSet& points = at.points;
  const auto nodes = out.contact_N.size();
  const auto per_segment = static_cast<std::size_t>(points.per_segment);
  std::vector<Vector3d>& force = out.contact_N;
  std::vector<double>& length_mm = out.tension_N;  // a temporary buffer: filled with tensions later
  std::fill(length_mm.begin(), length_mm.end(), 0);
  const auto share = [&](std::size_t q, const auto& add) {
    const std::size_t i = q / per_segment;
    const double t = static_cast<double>(q % per_segment + 1) / static_cast<double>(per_segment);
    add(i, 1 - t);
    add(i + 1, t);
  };
  for (std::size_t q = 0; q < points.position.size(); ++q) {
    share(q, [&](std::size_t i, double part) { length_mm[i] += part * points.weight_mm[q]; });
  }
  for (std::size_t k = 0; k < at.springs.size(); ++k) {
    const WallSpring& spring = at.springs[k];
    if (!(spring.penetration_mm > 0)) continue;
    const auto q = static_cast<std::size_t>(points.near[k]);
    const Vector3d normal_N =
        spring.stiffness_N_mm * spring.penetration_mm * points.clearance[q].gradient;
    share(q, [&](std::size_t i, double part) { force[i] += part * normal_N; });
  }
  for (std::size_t i = 0; i < nodes; ++i) {
    out.line_load_N_mm[i] = length_mm[i] > 0 ? force[i].norm() / length_mm[i] : 0;
  }
  for (std::size_t q = 0; q < points.position.size(); ++q) {
    share(q, [&](std::size_t i, double part) { force[i] -= part * out.friction.gradient[q]; });
  }
}

void FindTension(const WireModel& model, const WireState& state, const Expansion& at,
                 InternalForces& out) {
  const auto n = static_cast<std::size_t>(state.segments());
  const auto per_segment = static_cast<std::size_t>(at.points.per_segment);
  const std::vector<Vector3d>& tangents = state.tangents();
  out.tension_N[0] = -at.distal_gradient[0].dot(model.sheath().direction);
  for (std::size_t i = 1; i <= n; ++i) {
    // The load at the node itself counts half on either side; at the end it counts in full.
    const Vector3d& at_node = out.loads.point_gradient_N[per_segment * i - 1];
    out.tension_N[i] = i == n ? -at_node.dot(tangents[i - 1])
                              : -(at.distal_gradient[i] + at_node / 2)
                                     .dot((tangents[i - 1] + tangents[i]).normalized());
  }
}

// Twisting moment at joint i of a wire that twists: the sum over all instruments.
double TwistingMoment(const WireModel& model, const WireState& state, int joint) {
  double torque = 0;
  for (int k = 0; k < model.spins(); ++k) {
    torque += TwistStiffnessOf(model, state, joint, k) * state.TwistOf(joint, k);
  }
  return torque;
}

// Torque of lumen friction on the surface of the first of two curves, at a place.
double LumenTorque(const WireState& state, const BetweenCurves::Slide& slide) {
  return -slide.load.gradient[1] *
         (state.outer_leads() ? slide.outer_spin_mm : slide.inner_spin_mm);
}

void FindMoments(const WireModel& model, const WireState& state, const Expansion& at,
                 InternalForces& out) {
  const int n = state.segments();
  const bool twists = model.spins() > 0;
  const auto per_segment = static_cast<std::size_t>(at.points.per_segment);
  Vector3d end = Vector3d::Zero();
  for (const TangentLoad& on : at.derivatives.on_tangents) {
    if (on.segment == n - 1 && !on.on_second) end += on.gradient.cross(state.tangents().back());
  }
  out.bending_mJ[static_cast<std::size_t>(n)] = end.norm();
  double torque = 0;
  double surface = 0;
  std::size_t slides = at.between.slides.size();  // slides not yet counted
  for (int i = n - 1; i >= 0; --i) {
    const auto k = static_cast<std::size_t>(i);
    const Vector3d moment = BendingMoment(model, state, i);
    const Vector3d& before = i == 0 ? model.sheath().direction : state.tangents()[k - 1];
    out.bending_mJ[k] = moment.norm();
    // A wire that does not twist transmits the torques on its bent tip and on its surface.
    const double own = moment.dot(before);
    for (std::size_t q = per_segment * k; q < per_segment * (k + 1); ++q) {
      if (!at.points.OnSecond(static_cast<int>(q))) surface += out.surface_torque_mJ[q];
    }
    for (; !twists && slides > 0 && at.between.slides[slides - 1].segment >= i; --slides) {
      surface += LumenTorque(state, at.between.slides[slides - 1]);
    }
    torque = twists ? TwistingMoment(model, state, i) : torque + own;
    out.twisting_mJ[k] = torque + surface;
    if (i > 0) continue;
    const Vector3d& after = state.tangents().front();
    out.clamp_moment_mJ = -moment;
    if (twists) {
      out.clamp_moment_mJ -= torque / (1 + before.dot(after)) * (before + after);
    } else {
      out.clamp_moment_mJ -= (torque - own) * before;
    }
  }
  if (twists) out.twisting_mJ[static_cast<std::size_t>(n)] = out.twisting_mJ.end()[-2];
}

}  // namespace

void FindCurveLoads(const WireState& state, const Expansion& at, bool second, CurveLoads& out) {
  const PointSet& points = at.points;
  out.point_gradient_N.assign(static_cast<std::size_t>(points.SizeOf(second)), Vector3d::Zero());
  const auto take = [&](const PositionDerivatives& loads, bool covered) {
    for (std::size_t q = 0; q < loads.used.size(); ++q) {
      if (loads.used[q] == PositionDerivatives::kNothing) continue;
      if ((points.OnSecond(static_cast<int>(q)) != covered) != second) continue;
      out.point_gradient_N[q] += loads.gradient[q];
    }
  };
  take(at.derivatives, false);
  take(at.derivatives.covered, true);
  for (std::size_t k = 0; k < at.springs.size(); ++k) {
    const WallSpring& spring = at.springs[k];
    const int q = points.near[k];
    if (!(spring.penetration_mm > 0) || points.OnSecond(q) != second) continue;
    const auto p = static_cast<std::size_t>(q);
    out.point_gradient_N[p] -=
        spring.stiffness_N_mm * spring.penetration_mm * points.clearance[p].gradient;
  }
  out.in_lumen.clear();
  const WireState* const other = state.second();
  if (other == nullptr) return;
  const Eigen::Index part = second ? 5 : 0;
  const bool inner = second == state.outer_leads();
  const WireState& inner_curve = state.outer_leads() ? *other : state;
  const auto add = [&](const auto& place, const Vector3d& force_N, double unfelt_N) {
    out.in_lumen.push_back({.segment = place.segment,
                            .past_mm = place.past_mm + (inner ? 0 : place.ahead_mm),
                            .force_N = force_N,
                            .unfelt_N = unfelt_N});
  };
  for (const BetweenCurves::Spring& spring : at.between.springs) {
    if (!(spring.penetration_mm > 0)) continue;
    const Vector3d force_N =
        -spring.stiffness_N_mm * spring.penetration_mm * spring.approach.segment<3>(part);
    // The force is across the outer curve. It pushes an inclined inner curve along itself, and only
    // the shorter curve feels that.
    const double along_N =
        force_N.dot(inner_curve.tangents()[static_cast<std::size_t>(spring.segment)]);
    add(spring, force_N, inner == second ? 0 : along_N);
  }
  for (const BetweenCurves::Slide& slide : at.between.slides) {
    add(slide,
        -slide.load.gradient[0] * slide.along.segment<3>(part) -
            slide.load.gradient[1] * slide.around.segment<3>(part),
        0);
  }
}

void FindInternalForces(const WireModel& model, const WireState& state, const Expansion& expansion,
                        const std::vector<EnergyTerm*>& terms, InternalForces& out) {
  const int n = state.segments();
  const auto nodes = static_cast<std::size_t>(n) + 1;
  out.contact_N.assign(nodes, Vector3d::Zero());
  out.line_load_N_mm.assign(nodes, 0);
  out.tension_N.assign(nodes, 0);
  out.bending_mJ.assign(nodes, 0);
  out.twisting_mJ.assign(nodes, 0);
  out.clamp_force_N.setZero();
  out.clamp_moment_mJ.setZero();
  if (n == 0) return;
  FindFriction(expansion.points, terms, out.friction);
  out.surface_torque_mJ.assign(expansion.points.position.size(), 0);
  if (model.spins() == 0) FindSurfaceTorques(expansion.points, out);
  FindContacts(expansion, out);
  FindCurveLoads(state, expansion, false, out.loads);
  FindTension(model, state, expansion, out);
  FindMoments(model, state, expansion, out);
  out.clamp_force_N = expansion.distal_gradient[0];
}

}  // namespace torquer
