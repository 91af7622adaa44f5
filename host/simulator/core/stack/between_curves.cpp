#include "host/simulator/core/stack/between_curves.h"

#include <Eigen/Geometry>
#include <cmath>

namespace torquer {

using Eigen::Vector3d;
using Vector = BetweenCurves::Vector;
using Matrix = BetweenCurves::Matrix;

namespace {

// Distance from the lumen's wall, mm, up to which a place takes part in the model of a step.
constexpr double kNearLumenMm = 0.05;
// Offset between the curves, mm, below which it has no usable direction.
constexpr double kNoOffsetMm = 1e-9;

// Both curves, and the indices of their unknowns in a Vector.
struct Curves {
  Curves(const InstrumentStack& of, const WireState& state, const WireState& second,
         const std::vector<Frame>& frames, const std::vector<Frame>& second_frames)
      : stack(of),
        first(state),
        inner(state.outer_leads() ? second : state),
        outer(state.outer_leads() ? state : second),
        inner_frames(state.outer_leads() ? second_frames : frames),
        outer_frames(state.outer_leads() ? frames : second_frames),
        inner_rod(state.outer_leads() ? *of.second_rod() : of.rod()),
        inner_at(state.outer_leads() ? 5 : 0),
        outer_at(state.outer_leads() ? 0 : 5) {}

  double LengthMm(int segment) const { return first.SegmentLength(inner_rod, segment); }
  double BeginMm(int segment) const {
    return segment == 0 ? 0 : first.first_segment_mm() + (segment - 1) * inner_rod.segment_mm();
  }

  const InstrumentStack& stack;
  const WireState& first;
  const WireState& inner;
  const WireState& outer;
  const std::vector<Frame>& inner_frames;
  const std::vector<Frame>& outer_frames;
  const WireModel& inner_rod;
  Eigen::Index inner_at;
  Eigen::Index outer_at;
};

// Pair of facing places on a segment of both curves; `t` past the segment's proximal node on the
// inner one.
struct Beside {
  Beside(const Curves& both, int of_segment, double past_mm)
      : curves(both),
        segment(of_segment),
        at(static_cast<std::size_t>(of_segment)),
        t(past_mm),
        past_end_mm(t - both.LengthMm(of_segment)),
        inward(both.inner.tangents()[at]),
        along(both.outer.tangents()[at]),
        apart(both.inner.nodes()[at] + t * inward - both.outer.nodes()[at] - t * along),
        ahead_mm(along.dot(apart)),
        across(apart - ahead_mm * along),
        offset_mm(across.norm()),
        lumen_mm(both.stack.LumenRadius(both.first.places(), both.BeginMm(segment) + t)),
        radius_mm(both.inner_rod.radius_mm(both.inner.segments() - 1 - segment)) {}

  double penetration_mm() const { return offset_mm - (lumen_mm - radius_mm); }

  // Derivative by the steps of the relative position along `way` of the inner place against the
  // outer one. The outer place is `beyond_mm` farther along its own curve.
  Vector Follow(const Vector3d& way, double beyond_mm) const {
    Vector row;
    row.segment<3>(curves.inner_at) = way;
    row.segment<2>(curves.inner_at + 3) = past_end_mm * (curves.inner_frames[at].transpose() * way);
    row.segment<3>(curves.outer_at) = -way;
    row.segment<2>(curves.outer_at + 3) =
        -(past_end_mm + beyond_mm) * (curves.outer_frames[at].transpose() * way);
    return row;
  }
  // Adds the component along `way` of the turn of a curve's tangent.
  void TurnInner(const Vector3d& way, Vector& row) const {
    row.segment<2>(curves.inner_at + 3) += curves.inner_frames[at].transpose() * way;
  }
  void TurnOuter(const Vector3d& way, Vector& row) const {
    row.segment<2>(curves.outer_at + 3) += curves.outer_frames[at].transpose() * way;
  }

  const Curves& curves;
  int segment;
  std::size_t at;
  double t;
  double past_end_mm;      // negative: before the distal node
  const Vector3d& inward;  // tangent of the inner curve
  const Vector3d& along;   // tangent of the outer curve
  Vector3d apart;
  double ahead_mm;
  Vector3d across;
  double offset_mm;
  double lumen_mm;
  double radius_mm;
};

// Calls visit for every place, with its segment, its distance past the proximal node in mm, the
// length that it stands for in mm, and true at the end.
template <class Visit>
void ForPlaces(const Curves& curves, int segments, int points_per_segment, Visit visit) {
  const int per_segment = BetweenCurves::PlacesPerSegment(points_per_segment);
  const InstrumentPlaces& places = curves.first.places();
  const double reach_mm = curves.stack.SecondReach(places);
  for (int i = 0; i < segments; ++i) {
    const double piece = curves.LengthMm(i) / per_segment;
    const double end_mm = reach_mm - curves.BeginMm(i);
    for (int k = 0; k < per_segment; ++k) {
      const double t = (k + 0.5) * piece;
      visit(i, t, std::clamp(2 * (end_mm - t), 0.0, piece), false);
    }
  }
  // An edge acts along a length of about its own width.
  visit(segments - 1, std::max(0.0, reach_mm - curves.BeginMm(segments - 1)),
        curves.stack.LumenRadius(places, reach_mm), true);
}

// Contact force of two curves with its directions.
struct Press {
  double force_N;
  Vector3d normal;    // from the outer curve to the inner one
  Vector3d sideways;  // around the lumen
};

// Second-order terms of (43).
void Curve(const Beside& at, const Press& press, Matrix& out) {
  const double force_N = press.force_N;
  const Vector sideways = at.Follow(press.sideways, at.ahead_mm);
  const Vector onwards = at.Follow(at.along, at.ahead_mm);
  Vector tilt = Vector::Zero();
  at.TurnOuter(press.normal, tilt);
  out = (force_N / at.offset_mm) * sideways * sideways.transpose() -
        (force_N * at.offset_mm) * tilt * tilt.transpose();
  const Matrix turned = force_N * tilt * onwards.transpose();
  out -= turned + turned.transpose();
  // Third term of (4).
  const double bent = force_N * at.past_end_mm * press.normal.dot(at.inward);
  for (Eigen::Index a = 3; a < 5; ++a) out(at.curves.inner_at + a, at.curves.inner_at + a) -= bent;
}

// Second derivatives of the work of the force `gradient` along and around the lumen, without the
// turn of the inner surface. The directions turn with the lumen, and the steps have second-order
// terms too.
Matrix Curvature(const Beside& at, const Eigen::Vector2d& gradient, const Vector3d& around) {
  const auto turned = [&at](const Vector3d& way) {
    Vector row = Vector::Zero();
    at.TurnOuter(way, row);
    return row;
  };
  Matrix half = Matrix::Zero();
  for (int d = 0; d < 3; ++d) {
    const Vector3d axis = Vector3d::Unit(d);
    half += gradient[0] * turned(axis) *
            (at.Follow(axis, 0) + at.past_end_mm * turned(axis)).transpose();
  }
  half -=
      gradient[1] * turned(around) * (at.Follow(at.along, 0) + turned(at.across) / 2).transpose();
  const double on_outer = gradient[0] * (at.ahead_mm + at.past_end_mm) / 2;
  const double on_inner =
      at.past_end_mm * at.inward.dot(gradient[0] * at.along + gradient[1] * around) / 2;
  for (Eigen::Index a = 3; a < 5; ++a) {
    half(at.curves.outer_at + a, at.curves.outer_at + a) -= on_outer;
    half(at.curves.inner_at + a, at.curves.inner_at + a) -= on_inner;
  }
  return half + half.transpose();
}

// Angle from the first normal of a segment to that of an instrument that twists.
double TurnOf(const WireState& curve, std::size_t segment, int instrument) {
  if (curve.turns_rad().empty()) return 0;
  return curve.turns_rad()[segment][static_cast<std::size_t>(instrument)];
}

// First normal of the lumen.
Vector3d LumenNormal(const Beside& at, int outer) {
  const WireState& curve = at.curves.outer;
  return TurnedAbout(at.along, curve.normals()[at.at], TurnOf(curve, at.at, outer));
}

LumenContact ContactAt(const Beside& at) {
  const Curves& curves = at.curves;
  const InstrumentPlaces& places = curves.first.places();
  const double arc_mm = curves.BeginMm(at.segment) + at.t;
  LumenContact contact;
  contact.inner = curves.stack.InLumenAt(places, arc_mm);
  contact.outer = curves.stack.LumenAt(places, arc_mm);
  contact.radius_mm = at.radius_mm;
  contact.lumen_mm = at.lumen_mm;
  contact.ahead_mm = at.ahead_mm;
  const Vector3d normal = LumenNormal(at, contact.outer);
  const Vector3d second_normal = at.along.cross(normal);
  contact.offset_mm << at.across.dot(normal), at.across.dot(second_normal);
  const Vector3d& inner_normal = curves.inner.normals()[at.at];
  contact.turn_rad = std::atan2(inner_normal.dot(second_normal), inner_normal.dot(normal)) +
                     TurnOf(curves.inner, at.at, contact.inner);
  return contact;
}

}  // namespace

void BetweenCurves::Reserve(int segments, int points_per_segment) {
  const auto n = static_cast<std::size_t>(segments) + 1;
  springs.reserve(MostPlaces(segments, points_per_segment));
  slides.reserve(MostPlaces(segments, points_per_segment));
  terms.reserve(n);
  spin_terms.reserve(n);
}

void BetweenCurves::Place(const InstrumentStack& stack, const WireState& state,
                          int points_per_segment, const std::vector<Frame>& frames,
                          const std::vector<Frame>& second_frames,
                          std::vector<LumenContact>* lumen) {
  springs.clear();
  slides.clear();
  spin_terms.clear();
  if (lumen != nullptr) lumen->clear();
  energy_mJ = pressed_N = end_pressed_N = largest_offset_mm = 0;
  const int segments = state.second()->segments();
  terms.resize(static_cast<std::size_t>(segments));
  if (segments == 0) return;
  const Curves curves(stack, state, *state.second(), frames, second_frames);
  const auto press = [&](int segment, double t, double weight_mm, bool end) {
    if (lumen == nullptr && weight_mm == 0) return;
    const Beside at(curves, segment, t);
    if (lumen != nullptr) lumen->push_back(ContactAt(at));
    if (weight_mm == 0) return;
    largest_offset_mm = std::max(largest_offset_mm, at.offset_mm);
    const double penetration_mm = at.penetration_mm();
    if (penetration_mm < -kNearLumenMm || !(at.offset_mm > kNoOffsetMm)) return;
    Spring& spring = springs.emplace_back();
    spring.segment = segment;
    spring.past_mm = t;
    spring.ahead_mm = at.ahead_mm;
    spring.stiffness_N_mm = stack.clearance().stiffness_N_mm2 * weight_mm;
    spring.penetration_mm = penetration_mm;
    const Vector3d normal = at.across / at.offset_mm;
    spring.approach = at.Follow(normal, at.ahead_mm);
    if (penetration_mm <= 0) return;
    const double force_N = spring.stiffness_N_mm * penetration_mm;
    energy_mJ += force_N * penetration_mm / 2;
    pressed_N += force_N;
    if (end) end_pressed_N += force_N;
    if (lumen != nullptr) lumen->back().force_N = force_N;
    Curve(at, {force_N, normal, at.along.cross(normal)}, spring.curvature);
  };
  ForPlaces(curves, segments, points_per_segment, press);
}

void BetweenCurves::TakeSlides(const InstrumentStack& stack, const WireState& state,
                               const PointSet& points, const std::vector<SlideLoad>& loads,
                               const std::vector<Frame>& frames,
                               const std::vector<Frame>& second_frames) {
  slides.clear();
  if (loads.empty()) return;
  const bool twists = stack.rod().stack_twists();
  if (twists) spin_terms.resize(terms.size());
  for (SpinTerms& term : spin_terms) term.any = false;
  const Curves curves(stack, state, *state.second(), frames, second_frames);
  const int segments = state.second()->segments();
  const int last = static_cast<int>(points.lumen.size()) - 1;
  for (const SlideLoad& load : loads) {
    const LumenContact& contact = points.lumen[static_cast<std::size_t>(load.place)];
    const int i = load.place == last ? segments - 1 : load.place / points.lumen_per_segment;
    const double t = load.place == last
                         ? std::max(0.0, stack.SecondReach(state.places()) - curves.BeginMm(i))
                         : (load.place % points.lumen_per_segment + 0.5) * curves.LengthMm(i) /
                               points.lumen_per_segment;
    const Beside at(curves, i, t);
    Slide& slide = slides.emplace_back();
    slide.load = load;
    slide.segment = i;
    slide.past_mm = t;
    slide.ahead_mm = at.ahead_mm;
    slide.along = at.Follow(at.along, 0);
    at.TurnOuter(at.across, slide.along);
    // (47)
    const Vector3d normal = LumenNormal(at, contact.outer);
    const Vector3d around = load.around[0] * normal + load.around[1] * at.along.cross(normal);
    slide.around = at.Follow(around, at.ahead_mm);
    const Vector3d& inner_normal = curves.inner.normals()[at.at];
    const double inclined = at.along.dot(inner_normal);
    const Vector3d about =
        contact.radius_mm / (1 - inclined * inclined) * at.along.cross(inner_normal);
    at.TurnInner(-about.dot(at.inward) * inner_normal, slide.around);
    at.TurnOuter(-inclined * about, slide.around);
    slide.curvature = Curvature(at, load.gradient, around);
    slide.inner_spin_mm = contact.radius_mm;
    slide.outer_spin_mm = -contact.radius_mm - at.across.dot(around.cross(at.along));
    if (twists) AddSpins(slide, contact);
  }
}

BetweenCurves::Terms& BetweenCurves::TermsOf(int segment) {
  Terms& to = terms[static_cast<std::size_t>(segment)];
  if (to.any) return to;
  to.any = true;
  to.gradient.setZero();
  to.hessian.setZero();
  return to;
}

void BetweenCurves::Add(const Spring& spring) {
  Terms& to = TermsOf(spring.segment);
  to.gradient += (spring.stiffness_N_mm * spring.penetration_mm) * spring.approach;
  to.hessian += spring.stiffness_N_mm * spring.approach * spring.approach.transpose();
  if (spring.penetration_mm > 0) to.hessian += spring.curvature;
}

void BetweenCurves::Add(const Slide& slide) {
  Terms& to = TermsOf(slide.segment);
  const Eigen::Matrix2d& h = slide.load.hessian;
  to.gradient += slide.load.gradient[0] * slide.along + slide.load.gradient[1] * slide.around;
  const Vector with_along = h(0, 0) * slide.along + h(0, 1) * slide.around;
  const Vector with_around = h(1, 0) * slide.along + h(1, 1) * slide.around;
  to.hessian += slide.along * with_along.transpose() + slide.around * with_around.transpose() +
                slide.curvature;
}

void BetweenCurves::AddSpins(const Slide& slide, const LumenContact& contact) {
  SpinTerms& to = spin_terms[static_cast<std::size_t>(slide.segment)];
  if (!to.any) {
    to.any = true;
    to.with_steps.setZero();
    to.hessian.setZero();
  }
  const Eigen::Matrix2d& h = slide.load.hessian;
  const Vector with = h(1, 0) * slide.along + h(1, 1) * slide.around;
  const int spins[2] = {contact.inner, contact.outer};
  const double by[2] = {slide.inner_spin_mm, slide.outer_spin_mm};
  for (int a = 0; a < 2; ++a) {
    to.with_steps.row(spins[a]) += by[a] * with.transpose();
    for (int b = 0; b < 2; ++b) to.hessian(spins[a], spins[b]) += by[a] * by[b] * h(1, 1);
  }
}

}  // namespace torquer
