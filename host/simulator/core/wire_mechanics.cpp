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

WireMechanics::WireMechanics(const WireModel& model, const ClearanceField& field,
                             const WallModel& wall, const std::vector<EnergyTerm*>& terms,
                             const InstrumentStack* stack)
    : model_(model),
      wall_(wall),
      terms_(terms),
      stack_(stack),
      sheath_frame_(TangentFrame(model.sheath().direction, model.sheath_normal())),
      points_(model, field, wall, stack) {
  static const std::vector<EnergyTerm*> kNoTerms;
  if (stack == nullptr) return;
  second_ = std::make_unique<WireMechanics>(*stack->second_rod(), field, wall, kNoTerms);
}

// Extra room: terms that act between points use a few more places than there are points.
namespace {
constexpr std::size_t kMostMoments = 16;
}  // namespace

Expansion WireMechanics::MakeExpansion() const {
  const auto n = static_cast<std::size_t>(model_.max_segments()) + 1;
  const std::size_t points = n * static_cast<std::size_t>(wall_.points_per_segment);
  Expansion e;
  e.frames.reserve(n);
  e.joints.reserve(n);
  e.load_index.reserve(n);
  e.loads.reserve(n);
  e.distal_gradient.reserve(n + 1);
  e.gradient.reserve(n);
  if (model_.spins() > 0) {
    // Two curves may exchange roles, and then the numbers of their spins.
    const std::size_t spins = model_.twists() ? 1 : kMostInstruments;
    (model_.twists() ? e.twists.reserve(n) : e.stack.reserve(n));
    e.spin_gradient.reserve(n * spins);
    e.derivatives.on_spins.reserve(terms_.empty() ? 0 : kMostMoments + points);
    if (model_.stack_twists() && !terms_.empty()) {
      e.derivatives.between.reserve(n * spins);
      e.points.pressed_N.reserve(n);
    }
  } else if (model_.most_curved_joints() > 1) {
    e.turns.reserve(n);
  }
  points_.Reserve(e.points);
  e.springs.reserve(points);
  e.derivatives.Reserve(points);
  if (!terms_.empty()) e.derivatives.on_tangents.reserve(kMostMoments + points);
  if (second_ != nullptr) {
    e.second.push_back(second_->MakeExpansion());
    e.between.Reserve(model_.max_segments(), wall_.points_per_segment);
    e.derivatives.covered.Reserve(points);
    e.points.lumen_per_segment = BetweenCurves::PlacesPerSegment(wall_.points_per_segment);
    if (SlidesInLumen()) {
      const std::size_t places =
          BetweenCurves::MostPlaces(model_.max_segments(), wall_.points_per_segment);
      e.points.lumen.reserve(places);
      e.derivatives.in_lumen.reserve(places);
    }
  }
  return e;
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
    // Curvature of the wall. It is kept in full if it stiffens the spring or at most halves it. In
    // a deep corner the full curvature would make the whole Hessian indefinite.
    const double bend = spring.penetration_mm * sample.hessian.norm();
    const double keep = bend > 0.5 ? 0.5 / bend : 1;
    spring.hessian -= (spring.stiffness_N_mm * spring.penetration_mm * keep) * sample.hessian;
  }
}

void WireMechanics::ExpandJoints(const WireState& state, Expansion& out) const {
  const int n = state.segments();
  const int curved_from =
      n - model_.first_straight_joint() + 1;  // joints from this index on rest curved
  double curved = 0;
  double straight = 0;
  for (int i = 0; i < n; ++i) {
    const Vector3d& tangent_p = i == 0 ? model_.sheath().direction : state.tangents()[i - 1];
    const double stiffness = JointStiffness(model_, state, i);
    if (i < curved_from || model_.rest_direction(n - i)[2] == 1) {
      const Frame& frame_p = i == 0 ? sheath_frame_ : out.frames[i - 1];
      ExpandStraightJoint(model_.law(), stiffness, tangent_p, frame_p, state.tangents()[i],
                          out.frames[i], i < curved_from ? straight : curved, out.joints[i]);
    } else {
      // The normals of the clamp never turn, so any normal will do.
      const Vector3d& normal_p = i == 0 ? model_.sheath_normal() : state.normals()[i - 1];
      ExpandJoint(model_.law(), stiffness, tangent_p, normal_p, RestDirection(model_, state, i),
                  state.tangents()[i], state.normals()[i], curved, out.joints[i]);
    }
  }
  out.energy_mJ += straight + curved;
}

// Goes from the tip to the sheath: the twisting moment is the sum of the torques of all curved
// joints beyond.
void WireMechanics::ExpandTurningJoints(const WireState& state, Expansion& out) const {
  const int n = state.segments();
  const int curved_from = n - model_.first_straight_joint() + 1;
  out.turns.resize(static_cast<std::size_t>(n));
  double torque = 0;
  for (int i = n - 1; i >= 0; --i) {
    const Vector3d& tangent_p = i == 0 ? model_.sheath().direction : state.tangents()[i - 1];
    const Frame& frame_p = i == 0 ? sheath_frame_ : out.frames[i - 1];
    const double stiffness = JointStiffness(model_, state, i);
    TurnTerms& turn = out.turns[i];
    turn.rest = RestSpinTerms();
    if (i < curved_from || model_.rest_direction(n - i)[2] == 1) {
      ExpandStraightJoint(model_.law(), stiffness, tangent_p, frame_p, state.tangents()[i],
                          out.frames[i], torque, out.energy_mJ, out.joints[i], turn);
      continue;
    }
    const Vector3d& normal_p = i == 0 ? model_.sheath_normal() : state.normals()[i - 1];
    const Vector3d rest = RestDirection(model_, state, i);
    ExpandJoint(model_.law(), stiffness, tangent_p, normal_p, rest, state.tangents()[i],
                state.normals()[i], out.energy_mJ, out.joints[i]);
    AddTorque(torque, tangent_p, frame_p, state.tangents()[i], out.frames[i], out.joints[i], turn);
    if (i == 0) continue;  // the sheath does not turn
    turn.rest = SpinOfRest(model_.law(), stiffness, tangent_p, normal_p, rest, state.tangents()[i],
                           out.frames[i]);
    torque -= turn.rest.gradient;
  }
}

void WireMechanics::ExpandTwists(const WireState& state, Expansion& out) const {
  const int n = state.segments();
  out.twists.resize(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    const Vector3d& tangent_p = i == 0 ? model_.sheath().direction : state.tangents()[i - 1];
    const Frame& frame_p = i == 0 ? sheath_frame_ : out.frames[i - 1];
    AddTwist(TwistStiffness(model_, state, i), state.twist_rad()[i], tangent_p, frame_p,
             state.tangents()[i], out.frames[i], out.energy_mJ, out.joints[i], out.twists[i]);
  }
  for (int i = std::max(1, n - model_.first_straight_joint() + 1); i < n; ++i) {
    const RestSpinTerms rest =
        SpinOfRest(model_.law(), JointStiffness(model_, state, i), state.tangents()[i - 1],
                   state.normals()[i - 1], RestDirection(model_, state, i), state.tangents()[i],
                   out.frames[i]);
    TwistTerms& twist = out.twists[i];
    twist.gradient_proximal += rest.gradient;
    twist.hessian_proximal += rest.hessian;
    twist.proximal_proximal += rest.with_proximal;
    twist.proximal_distal += rest.with_distal;
  }
}

void WireMechanics::ExpandStack(const WireState& state, Expansion& out) const {
  const int n = state.segments();
  out.stack.resize(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    ExpandStackJoint(model_, state, i, i == 0 ? sheath_frame_ : out.frames[i - 1], out.frames[i],
                     out.energy_mJ, out.joints[i], out.stack[i]);
  }
}

void WireMechanics::AddSpinLoads(const WireState& state, Expansion& out) const {
  const int per_segment = out.points.per_segment;
  for (const SpinLoad& on : out.derivatives.on_spins) {
    const int i = on.point / per_segment;
    const double t =
        state.SegmentLength(model_, i) * (on.point % per_segment + 1) / per_segment - on.before_mm;
    const bool on_second = out.points.LiesOnSecond(on.instrument);
    Expansion& curve = on_second ? out.second.front() : out;
    const Vector2d with_step = t * (curve.frames[i].transpose() * on.with_position);
    if (!model_.twists()) {
      const int k = on.instrument - (on_second ? second_->model_ : model_).first_spin();
      StackTerms& stack = curve.stack[i];
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
}

void WireMechanics::AddBetweenLoads(Expansion& out) const {
  for (const BetweenLoad& on : out.derivatives.between) {
    const bool on_second = out.points.LiesOnSecond(on.inner);
    const int first = (on_second ? second_->model_ : model_).first_spin();
    const int a = on.inner - first;
    const int b = on.outer - first;
    Expansion& curve = on_second ? out.second.front() : out;
    StackTerms& stack = curve.stack[static_cast<std::size_t>(on.segment)];
    stack.gradient_distal[a] += on.gradient;
    stack.gradient_distal[b] -= on.gradient;
    stack.hessian_distal(a, a) += on.hessian;
    stack.hessian_distal(b, b) += on.hessian;
    stack.hessian_distal(a, b) -= on.hessian;
    stack.hessian_distal(b, a) -= on.hessian;
  }
}

bool WireMechanics::SlidesInLumen() const {
  return std::any_of(terms_.begin(), terms_.end(),
                     [](const EnergyTerm* term) { return term->SlidesInLumen(); });
}

// The spin gradient is added to the segments; all other terms go to `between`.
void WireMechanics::AddSlideLoads(const WireState& state, Expansion& out) const {
  Expansion& second = out.second.front();
  out.between.TakeSlides(*stack_, state, out.points, out.derivatives.in_lumen, out.frames,
                         second.frames);
  if (!model_.stack_twists()) return;
  Expansion& inner = state.outer_leads() ? second : out;
  Expansion& outer = state.outer_leads() ? out : second;
  for (const BetweenCurves::Slide& slide : out.between.slides) {
    const LumenContact& contact = out.points.lumen[static_cast<std::size_t>(slide.load.place)];
    const auto i = static_cast<std::size_t>(slide.segment);
    const double around_N = slide.load.gradient[1];
    inner.stack[i].gradient_distal[contact.inner] += slide.inner_spin_mm * around_N;
    outer.stack[i].gradient_distal[contact.outer - stack_->clearance().first_outer] +=
        slide.outer_spin_mm * around_N;
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

void WireMechanics::AddLoad(int point, bool on_second, double length_mm, const Vector3d& gradient,
                            const Matrix3d* hessian, Expansion& out) const {
  LoadTerms& load = LoadsOf(point / out.points.per_segment, on_second ? out.second.front() : out);
  const double t = length_mm * (point % out.points.per_segment + 1) / out.points.per_segment;
  load.g0 += gradient;
  load.g1 += t * gradient;
  if (hessian == nullptr) return;
  load.h0 += *hessian;
  load.h1 += t * *hessian;
  load.h2 += (t * t) * *hessian;
}

// Adds the loads of the terms on the points, or on the covered points.
void WireMechanics::AddLoads(const WireState& state, const PositionDerivatives& loads, bool covered,
                             Expansion& out) const {
  for (std::size_t p = 0; p < loads.used.size(); ++p) {
    if (loads.used[p] == PositionDerivatives::kNothing) continue;
    const int q = static_cast<int>(p);
    const bool with_hessian = loads.with_hessian && loads.used[p] == PositionDerivatives::kBoth;
    AddLoad(q, out.points.OnSecond(q) != covered,
            state.SegmentLength(model_, q / out.points.per_segment), loads.gradient[p],
            with_hessian ? &loads.hessian[p] : nullptr, out);
  }
}

template <class IsActive>
void WireMechanics::SumLoads(const WireState& state, IsActive is_active, Expansion& out) const {
  const int per_segment = out.points.per_segment;
  const bool with_hessian = out.derivatives.with_hessian;
  out.loads.clear();
  std::fill(out.load_index.begin(), out.load_index.end(), -1);
  if (second_ != nullptr) {
    Expansion& second = out.second.front();
    second.loads.clear();
    std::fill(second.load_index.begin(), second.load_index.end(), -1);
  }
  for (std::size_t k = 0; k < out.springs.size(); ++k) {
    if (!is_active(k)) continue;
    const WallSpring& spring = out.springs[k];
    const int q = out.points.near[k];
    const Vector3d gradient = -(spring.stiffness_N_mm * spring.penetration_mm) *
                              out.points.clearance[static_cast<std::size_t>(q)].gradient;
    AddLoad(q, out.points.OnSecond(q), state.SegmentLength(model_, q / per_segment), gradient,
            with_hessian ? &spring.hessian : nullptr, out);
  }
  if (terms_.empty()) return;
  AddLoads(state, out.derivatives, false, out);
  if (second_ != nullptr) AddLoads(state, out.derivatives.covered, true, out);
  for (const TangentLoad& on : out.derivatives.on_tangents) {
    LoadTerms& load = LoadsOf(on.segment, on.on_second ? out.second.front() : out);
    load.g1 += on.gradient;
    if (with_hessian) load.h2 += on.hessian;
  }
}

void WireMechanics::Model(const WireState& state, const std::vector<std::uint8_t>& active,
                          Expansion& out) const {
  SumLoads(
      state, [&active](std::size_t k) { return active[k] != 0; }, out);
}

// Sets the gradient by the spins of a segment. Returns the largest squared value over the local
// GJ/(1 mm).
double WireMechanics::SumSpins(const WireState& state, int segment, Expansion& out) const {
  const int n = state.segments();
  const auto i = static_cast<std::size_t>(segment);
  const auto take = [&](std::size_t at, double spin, double before, double beyond) {
    out.spin_gradient[at] = spin;
    const double torsional = std::min(before, beyond);
    return spin * spin / (torsional * torsional);
  };
  const bool last = segment + 1 == n;
  if (model_.twists()) {
    return take(i, out.twists[i].gradient_distal + (last ? 0 : out.twists[i + 1].gradient_proximal),
                model_.torsional_rigidity_N_mm2(n - segment),
                model_.torsional_rigidity_N_mm2(n - segment - 1));
  }
  const auto count = static_cast<std::size_t>(model_.spins());
  const auto first = static_cast<std::size_t>(model_.first_spin());
  double largest = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    const double spin =
        out.stack[i].gradient_distal[row] + (last ? 0 : out.stack[i + 1].gradient_proximal[row]);
    largest = std::max(
        largest,
        take(i * count + k, spin,
             model_.twisting_joint(n - segment).of[first + k].torsional_rigidity_N_mm2,
             model_.twisting_joint(n - segment - 1).of[first + k].torsional_rigidity_N_mm2));
  }
  return largest;
}

double WireMechanics::SumGradient(const WireState& state, Expansion& out) const {
  return SumGradient(state, nullptr, 0, out);
}

// `between`: contact loads between two curves; this curve has their entries from `part` on.
double WireMechanics::SumGradient(const WireState& state, const BetweenCurves* between,
                                  Eigen::Index part, Expansion& out) const {
  const int n = state.segments();
  double residual = 0;
  Vector3d beyond = Vector3d::Zero();
  out.distal_gradient[static_cast<std::size_t>(n)] = beyond;
  for (int i = n - 1; i >= 0; --i) {
    Vector2d pressed = Vector2d::Zero();
    if (between != nullptr && static_cast<std::size_t>(i) < between->terms.size()) {
      const BetweenCurves::Terms& terms = between->terms[static_cast<std::size_t>(i)];
      if (terms.any) {
        pressed = terms.gradient.segment<2>(part + 3);
        beyond += terms.gradient.segment<3>(part);
      }
    }
    Vector3d lever = state.SegmentLength(model_, i) * beyond;
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
    if (between != nullptr) g += Load(pressed.data());
    Store(g, out.gradient[i].data());
    // Uses the softer of the segment's two joints: an out-of-balance moment bends it most.
    const double rigidity =
        std::min(model_.rigidity_N_mm2(n - i), model_.rigidity_N_mm2(n - i - 1));
    residual = std::max(residual, Summed(g * g)[0] / (rigidity * rigidity));
    if (model_.spins() > 0) residual = std::max(residual, SumSpins(state, i, out));
  }
  return std::sqrt(residual);
}

void WireMechanics::PrepareSegments(const WireState& state, Expansion& out) const {
  const auto n = static_cast<std::size_t>(state.segments());
  out.frames.resize(n);
  for (std::size_t i = 0; i < n; ++i)
    out.frames[i] = TangentFrame(state.tangents()[i], state.normals()[i]);
  out.joints.resize(n);
  out.load_index.resize(n);
  out.distal_gradient.resize(n + 1);
  out.gradient.resize(n);
}

void WireMechanics::ExpandBending(const WireState& state, Expansion& out) const {
  out.turns.clear();
  if (model_.stack_twists()) {
    ExpandStack(state, out);
  } else if (!model_.twists() && model_.first_straight_joint() > 1) {
    ExpandTurningJoints(state, out);
  } else {
    ExpandJoints(state, out);
  }
}

void WireMechanics::ExpandSecond(const WireState& state, Expansion& out) const {
  const WireState& curve = *state.second();
  Expansion& second = out.second.front();
  second.energy_mJ = 0;
  second_->PrepareSegments(curve, second);
  second.spin_gradient.resize(static_cast<std::size_t>(curve.segments()) *
                              static_cast<std::size_t>(second_->model_.spins()));
  second_->ExpandBending(curve, second);
  out.between.Place(*stack_, state, wall_.points_per_segment, out.frames, second.frames,
                    SlidesInLumen() ? &out.points.lumen : nullptr);
  out.energy_mJ += second.energy_mJ + out.between.energy_mJ;
}

void WireMechanics::ExpandAll(const WireState& state, bool with_hessian, Expansion& out) {
  const auto n = static_cast<std::size_t>(state.segments());
  PrepareSegments(state, out);
  out.energy_mJ = out.dissipated_mJ = 0;

  points_.Place(state, with_hessian, out.points);
  const std::size_t points = out.points.position.size();
  out.derivatives.with_hessian = out.derivatives.covered.with_hessian = with_hessian;
  ExpandWall(with_hessian, out);
  ExpandBending(state, out);
  if (second_ != nullptr) ExpandSecond(state, out);
  out.spin_gradient.resize(n * static_cast<std::size_t>(model_.spins()));
  if (model_.twists()) ExpandTwists(state, out);
  if (!terms_.empty()) {
    out.derivatives.Clear(points);
    out.derivatives.covered.Clear(out.points.covered.size());
    out.derivatives.on_tangents.clear();
    out.derivatives.on_spins.clear();
    out.derivatives.between.clear();
    out.derivatives.in_lumen.clear();
    for (const EnergyTerm* term : terms_) {
      const double added_mJ = term->Add(out.points, out.derivatives);
      out.energy_mJ += added_mJ;
      if (term->Dissipates()) out.dissipated_mJ += added_mJ;
    }
    if (model_.spins() > 0) AddSpinLoads(state, out);
    if (model_.stack_twists()) AddBetweenLoads(out);
    if (second_ != nullptr) AddSlideLoads(state, out);
  }
  SumTrueGradient(state, out);
}

void WireMechanics::SumTrueGradient(const WireState& state, Expansion& out) const {
  SumLoads(
      state, [&out](std::size_t k) { return out.springs[k].penetration_mm > 0; }, out);
  if (second_ == nullptr) {
    out.residual = SumGradient(state, out);
    return;
  }
  out.between.SumTouching();
  out.residual =
      std::max(SumGradient(state, &out.between, 0, out),
               second_->SumGradient(*state.second(), &out.between, 5, out.second.front()));
}

void WireMechanics::Expand(const WireState& state, Expansion& out) { ExpandAll(state, true, out); }

void WireMechanics::ExpandGradient(const WireState& state, Expansion& out) {
  ExpandAll(state, false, out);
}

}  // namespace torquer
