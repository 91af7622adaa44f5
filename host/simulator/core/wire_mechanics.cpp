#include "host/simulator/core/wire_mechanics.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "host/simulator/core/pair.h"

namespace torquer {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

void ExpandJoint(BendingLaw law, double stiffness_mJ, const Vector3d& proximal_tangent,
                 const Vector3d& proximal_normal, const Vector3d& rest, const Vector3d& tangent,
                 const Vector3d& normal, double& energy_mJ, JointTerms& out) {
  // y = |u - r|^2 / 2 with u = tangent, and r = rest turning with the proximal segment by the
  // rotation vector phi = tangent_p x T_p xi_p = e1 xi_p1 + e2 xi_p2.
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

void ExpandStraightJoint(BendingLaw law, double stiffness_mJ, const Vector3d& proximal_tangent,
                         const Frame& proximal_frame, const Vector3d& tangent, const Frame& frame,
                         double& energy_mJ, JointTerms& out) {
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
}

void AddTwist(double stiffness_mJ, double twist_rad, const Vector3d& proximal_tangent,
              const Frame& proximal_frame, const Vector3d& tangent, const Frame& frame,
              double& energy_mJ, JointTerms& bending, TwistTerms& out) {
  // The twist grows by zeta_d - zeta_p, and by the area that the step sweeps on the sphere of
  // tangents: to first order g_p.xi_p + g_d.xi_d.
  const double k = stiffness_mJ;
  const double torque = k * twist_rad;
  energy_mJ += torque * twist_rad / 2;
  const double part = 1 / (1 + proximal_tangent.dot(tangent));
  const Vector2d h_p = proximal_frame.transpose() * tangent;
  const Vector2d h_d = frame.transpose() * proximal_tangent;
  const Vector2d g_p = part * Vector2d(-h_p[1], h_p[0]);
  const Vector2d g_d = part * Vector2d(h_d[1], -h_d[0]);
  bending.gradient_proximal += torque * g_p;
  bending.gradient_distal += torque * g_d;
  // The areas of triangles, to second order.
  const double half = torque * part / 2;
  const auto symmetric = [](const Vector2d& a, const Vector2d& b) {
    Matrix2d m;
    m << 2 * a[0] * b[0], a[0] * b[1] + a[1] * b[0], 0, 2 * a[1] * b[1];
    m(1, 0) = m(0, 1);
    return m;
  };
  bending.hessian_proximal += k * g_p * g_p.transpose() - half * symmetric(g_p, h_p);
  bending.hessian_distal += k * g_d * g_d.transpose() - half * symmetric(g_d, h_d);
  const Matrix2d across = proximal_frame.transpose() * frame;
  Matrix2d turned;  // the columns of `across`, a quarter turn on
  turned << across(0, 1), -across(0, 0), across(1, 1), -across(1, 0);
  bending.hessian_cross +=
      k * g_p * g_d.transpose() + (torque * part) * (turned - h_p * g_d.transpose());
  out.gradient_proximal = -torque;
  out.gradient_distal = torque;
  out.hessian_proximal = k;
  out.hessian_distal = k;
  out.hessian_cross = -k;
  out.proximal_proximal = -k * g_p;
  out.proximal_distal = -k * g_d;
  out.distal_proximal = k * g_p;
  out.distal_distal = k * g_d;
  out.distal_displacement.setZero();
}

void AddSpinOfRest(BendingLaw law, double stiffness_mJ, const Vector3d& proximal_tangent,
                   const Vector3d& proximal_normal, const Vector3d& rest, const Vector3d& tangent,
                   const Frame& frame, TwistTerms& out) {
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
  out.gradient_proximal += slope * y_spin;
  out.hessian_proximal +=
      curvature * y_spin * y_spin + slope * (1 - y - cosine * proximal_tangent.dot(rest));
  out.proximal_proximal +=
      curvature * y_spin * y_proximal - (slope * cosine) * Vector2d(e1.dot(rest), e2.dot(rest));
  out.proximal_distal +=
      curvature * y_spin * y_distal - slope * (frame.transpose() * proximal_tangent.cross(rest));
}

Frame TangentFrame(const Vector3d& tangent, const Vector3d& normal) {
  Frame frame;
  frame.col(0) = normal;
  frame.col(1) = tangent.cross(normal);
  return frame;
}

WireMechanics::WireMechanics(const WireModel& model, const ClearanceField& field,
                             const WallModel& wall, const std::vector<EnergyTerm*>& terms)
    : model_(model),
      field_(field),
      wall_(wall),
      terms_(terms),
      sheath_frame_(TangentFrame(model.sheath().direction, model.sheath_normal())),
      lipschitz_(field.LipschitzBound()),
      lookups_(static_cast<std::size_t>(model.max_segments() + 1) *
               static_cast<std::size_t>(wall.points_per_segment)) {
  ForgetLookups();
  if (wall.by_place != nullptr) stiffness_N_mm2_.assign(lookups_.size(), wall.stiffness_N_mm2);
}

void WireMechanics::TakeStiffness(const WireState& state) {
  if (wall_.by_place == nullptr) return;
  const int per_segment = wall_.points_per_segment;
  std::size_t q = static_cast<std::size_t>(state.segments() * per_segment);
  for (int i = 0; i < state.segments(); ++i) {
    const double length = state.SegmentLength(model_, i);
    for (int k = 1; k <= per_segment; ++k) {
      stiffness_N_mm2_[--q] =
          wall_.by_place->At(state.nodes[i] + (length * k / per_segment) * state.tangents[i]);
    }
  }
}

Expansion WireMechanics::MakeExpansion() const {
  const auto n = static_cast<std::size_t>(model_.max_segments()) + 1;
  const std::size_t points = n * static_cast<std::size_t>(wall_.points_per_segment);
  Expansion e;
  e.frames.reserve(n);
  e.joints.reserve(n);
  e.load_index.reserve(n);
  e.loads.reserve(n);
  e.costate.reserve(n + 1);
  e.gradient.reserve(n);
  if (model_.twists()) {
    e.twists.reserve(n);
    e.spin_gradient.reserve(n);
    e.derivatives.on_spins.reserve(terms_.empty() ? 0 : points);
  }
  e.points.per_segment = wall_.points_per_segment;
  e.points.position.reserve(points);
  e.points.weight_mm.reserve(points);
  e.points.radius_mm.reserve(points);
  e.points.touches.reserve(points);
  e.points.clearance.reserve(points);
  e.points.stiffness_N_mm2.reserve(points);
  e.points.near.reserve(points);
  e.springs.reserve(points);
  e.derivatives.used.reserve(points);
  e.derivatives.gradient.reserve(points);
  e.derivatives.hessian.reserve(points);
  if (!terms_.empty()) e.derivatives.on_tangents.reserve(8 + (model_.twists() ? points : 0));
  return e;
}

void WireMechanics::ForgetLookups() {
  for (Lookup& look : lookups_) look.free_mm = -1;
}

void WireMechanics::PlacePoints(const WireState& state, bool with_hessian, PointSet& points) {
  const int n = state.segments();
  const int per_segment = wall_.points_per_segment;
  const auto count = static_cast<std::size_t>(n * per_segment);
  points.per_segment = per_segment;
  points.position.resize(count);
  points.weight_mm.resize(count);
  points.radius_mm.resize(count);
  points.touches.resize(count);
  points.clearance.resize(count);
  points.stiffness_N_mm2.resize(count);
  points.near.clear();
  points.start = state.nodes.front();
  points.normals = model_.twists() ? &state.normals : nullptr;
  const double travel = field_.TravelMm();
  std::size_t q = 0;
  for (int i = 0; i < n; ++i) {
    const double length = state.SegmentLength(model_, i);
    const double radius = model_.radius_mm(n - 1 - i);
    for (int k = 1; k <= per_segment; ++k, ++q) {
      const Vector3d at =
          k == per_segment
              ? state.nodes[static_cast<std::size_t>(i) + 1]
              : Vector3d(state.nodes[i] + (length * k / per_segment) * state.tangents[i]);
      points.position[q] = at;
      points.weight_mm[q] = length / per_segment;
      points.radius_mm[q] = radius;
      Lookup& look = lookups_[count - 1 - q];
      const double free = look.free_mm - travel / lipschitz_;
      if (free > 0 && (at - look.at).squaredNorm() < free * free) {
        points.touches[q] = 0;
        continue;
      }
      ClearanceSample& sample = points.clearance[q];
      if (with_hessian) {
        field_.EvaluateHessian(at, sample);
      } else {
        field_.EvaluateGradient(at, sample);
      }
      points.touches[q] = sample.clearance_mm < radius;
      look.at = at;
      look.free_mm = (sample.clearance_mm - radius - kNearMm + travel) / lipschitz_;
      if (sample.clearance_mm >= radius + kNearMm) continue;
      points.near.push_back(static_cast<int>(q));
      points.stiffness_N_mm2[q] =
          stiffness_N_mm2_.empty() ? wall_.stiffness_N_mm2 : stiffness_N_mm2_[count - 1 - q];
    }
  }
}

void WireMechanics::ExpandWall(bool with_hessian, Expansion& out) const {
  out.springs.clear();
  out.max_penetration_mm = 0;
  for (const int q : out.points.near) {
    const auto p = static_cast<std::size_t>(q);
    const ClearanceSample& sample = out.points.clearance[p];
    WallSpring& spring = out.springs.emplace_back();
    spring.stiffness_N_mm = out.points.stiffness_N_mm2[p] * out.points.weight_mm[p];
    spring.penetration_mm = out.points.radius_mm[p] - sample.clearance_mm;
    if (out.points.touches[p]) {
      out.max_penetration_mm = std::max(out.max_penetration_mm, spring.penetration_mm);
      out.energy_mJ += spring.stiffness_N_mm * spring.penetration_mm * spring.penetration_mm / 2;
    }
    if (!with_hessian) continue;
    spring.hessian.noalias() =
        spring.stiffness_N_mm * sample.gradient * sample.gradient.transpose();
    if (!out.points.touches[p]) continue;
    // The curvature of the wall, where it stiffens or no more than halves the spring: deep in a
    // corner it would make the whole Hessian indefinite.
    const double bend = spring.penetration_mm * sample.hessian.norm();
    const double keep = bend > 0.5 ? 0.5 / bend : 1;
    spring.hessian -= (spring.stiffness_N_mm * spring.penetration_mm * keep) * sample.hessian;
  }
}

void WireMechanics::ExpandJoints(const WireState& state, int first, Expansion& out) const {
  const int n = state.segments();
  const int curved_from = n - model_.first_straight_joint() + 1;  // joints from here rest curved
  double curved = 0;
  double straight = 0;
  for (int i = first; i < n; ++i) {
    const Vector3d& tangent_p = i == 0 ? model_.sheath().direction : state.tangents[i - 1];
    const double stiffness = JointStiffness(model_, state, i);
    if (i < curved_from || model_.rest_direction(n - i)[2] == 1) {
      const Frame& frame_p = i == 0 ? sheath_frame_ : out.frames[i - 1];
      ExpandStraightJoint(model_.law(), stiffness, tangent_p, frame_p, state.tangents[i],
                          out.frames[i], i < curved_from ? straight : curved, out.joints[i]);
    } else {
      // The clamp's normals are never turned: any will do.
      const Vector3d& normal_p = i == 0 ? model_.sheath_normal() : state.normals[i - 1];
      ExpandJoint(model_.law(), stiffness, tangent_p, normal_p, RestDirection(model_, state, i),
                  state.tangents[i], state.normals[i], curved, out.joints[i]);
    }
  }
  out.energy_mJ += straight + curved - out.curved_joints_mJ;
  out.curved_joints_mJ = curved;
}

void WireMechanics::ExpandTwists(const WireState& state, Expansion& out) const {
  const int n = state.segments();
  out.twists.resize(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    const Vector3d& tangent_p = i == 0 ? model_.sheath().direction : state.tangents[i - 1];
    const Frame& frame_p = i == 0 ? sheath_frame_ : out.frames[i - 1];
    AddTwist(TwistStiffness(model_, state, i), state.twist_rad[i], tangent_p, frame_p,
             state.tangents[i], out.frames[i], out.energy_mJ, out.joints[i], out.twists[i]);
  }
  for (int i = std::max(1, n - model_.first_straight_joint() + 1); i < n; ++i) {
    AddSpinOfRest(model_.law(), JointStiffness(model_, state, i), state.tangents[i - 1],
                  state.normals[i - 1], RestDirection(model_, state, i), state.tangents[i],
                  out.frames[i], out.twists[i]);
  }
}

void WireMechanics::AddSpinLoads(const WireState& state, Expansion& out) const {
  const int per_segment = out.points.per_segment;
  for (const SpinLoad& on : out.derivatives.on_spins) {
    const int i = on.point / per_segment;
    const double t = state.SegmentLength(model_, i) * (on.point % per_segment + 1) / per_segment;
    TwistTerms& twist = out.twists[i];
    twist.gradient_distal += on.gradient;
    twist.hessian_distal += on.hessian;
    twist.distal_displacement += on.with_position;
    twist.distal_distal += t * (out.frames[i].transpose() * on.with_position);
  }
}

LoadTerms& WireMechanics::LoadsOf(int segment, Expansion& out) const {
  if (out.load_index[segment] < 0) {
    out.load_index[segment] = static_cast<int>(out.loads.size());
    out.loads.push_back(
        {Vector3d::Zero(), Vector3d::Zero(), Matrix3d::Zero(), Matrix3d::Zero(), Matrix3d::Zero()});
  }
  return out.loads[out.load_index[segment]];
}

void WireMechanics::AddLoad(int point, double length_mm, const Vector3d& gradient,
                            const Matrix3d* hessian, Expansion& out) const {
  LoadTerms& load = LoadsOf(point / out.points.per_segment, out);
  const double t = length_mm * (point % out.points.per_segment + 1) / out.points.per_segment;
  load.g0 += gradient;
  load.g1 += t * gradient;
  if (hessian == nullptr) return;
  load.h0 += *hessian;
  load.h1 += t * *hessian;
  load.h2 += (t * t) * *hessian;
}

template <class IsActive>
void WireMechanics::SumLoads(const WireState& state, IsActive is_active, Expansion& out) const {
  const int per_segment = out.points.per_segment;
  const bool with_hessian = out.derivatives.with_hessian;
  out.loads.clear();
  std::fill(out.load_index.begin(), out.load_index.end(), -1);
  for (std::size_t k = 0; k < out.springs.size(); ++k) {
    if (!is_active(k)) continue;
    const WallSpring& spring = out.springs[k];
    const int q = out.points.near[k];
    const Vector3d gradient = -(spring.stiffness_N_mm * spring.penetration_mm) *
                              out.points.clearance[static_cast<std::size_t>(q)].gradient;
    AddLoad(q, state.SegmentLength(model_, q / per_segment), gradient,
            with_hessian ? &spring.hessian : nullptr, out);
  }
  if (terms_.empty()) return;
  for (int q = 0; q < out.points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    if (out.derivatives.used[p] == PointDerivatives::kNothing) continue;
    AddLoad(q, state.SegmentLength(model_, q / per_segment), out.derivatives.gradient[p],
            with_hessian && out.derivatives.used[p] == PointDerivatives::kBoth
                ? &out.derivatives.hessian[p]
                : nullptr,
            out);
  }
  for (const TangentLoad& on : out.derivatives.on_tangents) {
    LoadTerms& load = LoadsOf(on.segment, out);
    load.g1 += on.gradient;
    if (with_hessian) load.h2 += on.hessian;
  }
}

void WireMechanics::Model(const WireState& state, const std::vector<std::uint8_t>& active,
                          Expansion& out) const {
  SumLoads(
      state, [&active](std::size_t k) { return active[k] != 0; }, out);
}

double WireMechanics::SumGradient(const WireState& state, Expansion& out) const {
  const int n = state.segments();
  double residual = 0;
  Vector3d beyond = Vector3d::Zero();
  out.costate[static_cast<std::size_t>(n)] = beyond;
  for (int i = n - 1; i >= 0; --i) {
    Vector3d lever = state.SegmentLength(model_, i) * beyond;
    const int at = out.load_index[i];
    if (at >= 0) {
      lever += out.loads[at].g1;
      beyond += out.loads[at].g0;
    }
    out.costate[i] = beyond;
    const double* frame = out.frames[i].data();
    Pair g = Load(frame) * Both(lever[0]) + Load(frame + 2) * Both(lever[1]) +
             Load(frame + 4) * Both(lever[2]) + Load(out.joints[i].gradient_distal.data());
    if (i + 1 < n) g += Load(out.joints[i + 1].gradient_proximal.data());
    Store(g, out.gradient[i].data());
    // The softer of the segment's two joints: what an out-of-balance moment bends most.
    const double rigidity =
        std::min(model_.rigidity_N_mm2(n - i), model_.rigidity_N_mm2(n - i - 1));
    residual = std::max(residual, Summed(g * g)[0] / (rigidity * rigidity));
    if (out.twists.empty()) continue;
    double spin = out.twists[i].gradient_distal;
    if (i + 1 < n) spin += out.twists[i + 1].gradient_proximal;
    out.spin_gradient[i] = spin;
    const double torsional = std::min(model_.torsional_rigidity_N_mm2(n - i),
                                      model_.torsional_rigidity_N_mm2(n - i - 1));
    residual = std::max(residual, spin * spin / (torsional * torsional));
  }
  return std::sqrt(residual);
}

void WireMechanics::ExpandAll(const WireState& state, bool with_hessian, Expansion& out) {
  const auto n = static_cast<std::size_t>(state.segments());
  out.frames.resize(n);
  for (std::size_t i = 0; i < n; ++i)
    out.frames[i] = TangentFrame(state.tangents[i], state.normals[i]);
  out.joints.resize(n);
  out.load_index.resize(n);
  out.costate.resize(n + 1);
  out.gradient.resize(n);
  out.energy_mJ = 0;
  out.curved_joints_mJ = 0;

  PlacePoints(state, with_hessian, out.points);
  const std::size_t points = out.points.position.size();
  out.derivatives.with_hessian = with_hessian;
  ExpandWall(with_hessian, out);
  ExpandJoints(state, 0, out);
  if (model_.twists()) {
    out.spin_gradient.resize(n);
    ExpandTwists(state, out);
  }
  if (!terms_.empty()) {
    out.derivatives.gradient.resize(points);
    out.derivatives.hessian.resize(points);
    out.derivatives.used.assign(points, 0);
    out.derivatives.on_tangents.clear();
    out.derivatives.on_spins.clear();
    for (const EnergyTerm* term : terms_) out.energy_mJ += term->Add(out.points, out.derivatives);
    if (model_.twists()) AddSpinLoads(state, out);
  }
  SumTrueGradient(state, out);
}

void WireMechanics::SumTrueGradient(const WireState& state, Expansion& out) const {
  SumLoads(
      state, [&out](std::size_t k) { return out.springs[k].penetration_mm > 0; }, out);
  out.residual = SumGradient(state, out);
}

void WireMechanics::Expand(const WireState& state, Expansion& out) { ExpandAll(state, true, out); }

void WireMechanics::ExpandGradient(const WireState& state, Expansion& out) {
  ExpandAll(state, false, out);
}

void WireMechanics::ExpandCurvedJoints(const WireState& state, Expansion& out) {
  const int first = std::max(0, state.segments() - model_.first_straight_joint() + 1);
  if (first >= state.segments()) return;
  ExpandJoints(state, first, out);
  out.residual = SumGradient(state, out);
}

}  // namespace torquer
