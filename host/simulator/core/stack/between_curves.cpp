#include "host/simulator/core/stack/between_curves.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "host/simulator/core/stack/pair_builder.h"

namespace torquer {

using Eigen::Vector3d;
using Vector = BetweenCurves::Vector;
using Matrix = BetweenCurves::Matrix;

namespace {

// Distance from the lumen's wall, mm, up to which a place takes part in the model of a step.
constexpr double kNearLumenMm = 0.05;
// Distance by which a wire may lie behind the segment that it faces, in radii of the lumen.
constexpr double kFoldedBack = 4;
// Offset between the curves, mm, below which it has no usable direction.
constexpr double kNoOffsetMm = 1e-9;

using Geometry = BetweenCurves::Geometry;

// First unknowns of each curve in a Vector.
constexpr Eigen::Index kInner = 0;
constexpr Eigen::Index kOuter = 5;

// Place on the inner curve with its foot on the line of the outer segment, both as chords. The
// bulges do not affect the sliding of surfaces.
struct Beside {
  Beside(const LumenPlace& of, const Geometry& inner_curve, const Geometry& outer_curve)
      : place(of),
        i(static_cast<std::size_t>(of.segment)),
        m(static_cast<std::size_t>(of.outer_segment)),
        inner(inner_curve),
        outer(outer_curve),
        inward(inner.curve.tangents()[i]),
        along(outer.curve.tangents()[m]),
        apart(inner.curve.nodes()[i] + of.past_mm * inward - outer.curve.nodes()[m]),
        foot_mm(along.dot(apart)),
        across(apart - foot_mm * along),
        past_end_mm(of.past_mm - inner.curve.SegmentLength(inner.rod, of.segment)),
        foot_past_end_mm(foot_mm - outer.curve.SegmentLength(outer.rod, of.outer_segment)) {}

  // Derivative by the steps of the position along `way` of the place against its foot.
  Vector Follow(const Vector3d& way) const { return Follow(way, foot_past_end_mm); }
  // The same against the distal node of the outer segment.
  Vector FollowNode(const Vector3d& way) const { return Follow(way, 0); }
  // Adds the component along `way` of the turn of a curve's tangent.
  void TurnInner(const Vector3d& way, Vector& row) const {
    row.segment<2>(kInner + 3) += inner.frames[i].transpose() * way;
  }
  void TurnOuter(const Vector3d& way, Vector& row) const {
    row.segment<2>(kOuter + 3) += outer.frames[m].transpose() * way;
  }

  const LumenPlace& place;
  std::size_t i;  // segment of the inner curve
  std::size_t m;  // segment of the outer curve
  const Geometry& inner;
  const Geometry& outer;
  const Vector3d& inward;  // tangent of the inner curve
  const Vector3d& along;   // tangent of the outer curve
  Vector3d apart;          // from the proximal node of the outer segment
  double foot_mm;
  Vector3d across;
  double past_end_mm;       // negative: before the distal node of the inner segment
  double foot_past_end_mm;  // same, of the foot on the outer segment

 private:
  Vector Follow(const Vector3d& way, double outer_past_end_mm) const {
    Vector row;
    row.segment<3>(kInner) = way;
    row.segment<2>(kInner + 3) = past_end_mm * (inner.frames[i].transpose() * way);
    row.segment<3>(kOuter) = -way;
    row.segment<2>(kOuter + 3) = -outer_past_end_mm * (outer.frames[m].transpose() * way);
    return row;
  }
};

// Derivative of a vector that is fixed to a segment, by the segment's step. By (5) it turns by phi
// = [second normal, -normal] xi.
Frame Turning(const Frame& frame, const Vector3d& vector) {
  Frame turning;
  turning.col(0) = frame.col(1).cross(vector);
  turning.col(1) = -frame.col(0).cross(vector);
  return turning;
}

// Point of one curve and the tangent of the other at its foot, both with their bulges: each is
// fixed to its segment. The point is on the inner curve, but for the mouth.
struct Pressed {
  Pressed(const LumenPlace& of, const Geometry& inner, const Geometry& outer)
      : place(of), point_at(of.is_mouth ? kOuter : kInner), foot_at(of.is_mouth ? kInner : kOuter) {
    const Geometry& own = of.is_mouth ? outer : inner;
    const Geometry& other = of.is_mouth ? inner : outer;
    const int segment = of.is_mouth ? of.outer_segment : of.segment;
    const int faced = of.is_mouth ? of.segment : of.outer_segment;
    const auto i = static_cast<std::size_t>(segment);
    const auto m = static_cast<std::size_t>(faced);
    frame = own.frames[i];
    foot_frame = other.frames[m];
    const double length_mm = own.curve.SegmentLength(own.rod, segment);
    const double faced_mm = other.curve.SegmentLength(other.rod, faced);
    const Vector3d& chord = other.curve.tangents()[m];
    const double past_end_mm = of.is_mouth ? 0 : of.past_mm - length_mm;
    past_node = past_end_mm * own.curve.tangents()[i] + frame * of.bulge_mm;
    along = (chord + foot_frame * of.foot_slope).normalized();
    // The foot slides along that tangent.
    const Vector3d begin = ((of.is_mouth ? of.past_mm : of.foot_mm) - faced_mm) * chord +
                           foot_frame * of.foot_bulge_mm;
    const Vector3d apart =
        own.curve.nodes()[i + 1] + past_node - other.curve.nodes()[m + 1] - begin;
    foot_past_node = begin + along.dot(apart) * along;
    foot_mm = faced_mm + chord.dot(foot_past_node);
    // A wire that folds back inside the lumen may not leave it through the sheath.
    if (!of.is_mouth && sign() > 0) {
      const double least_mm = -std::min(ArcMm(other.rod, other.curve, faced),
                                        other.rod.segment_mm() + kFoldedBack * of.lumen_mm);
      foot_is_fixed = foot_mm < least_mm;
      if (foot_is_fixed) {
        foot_past_node += (least_mm - foot_mm) / chord.dot(along) * along;
        foot_mm = least_mm;
      }
    }
    across = apart + begin - foot_past_node;
    offset_mm = across.norm();
  }
  // Beside the outer curve, contact begins below the sum of both radii.
  double sign() const { return place.lever_mm < 0 ? -1 : 1; }
  double penetration_mm() const { return sign() * (offset_mm - (place.lumen_mm - place.lever_mm)); }

  // Derivative by the steps of the position along `way` of the point against its foot.
  Vector Follow(const Vector3d& way) const {
    Vector row;
    row.segment<3>(point_at) = way;
    row.segment<2>(point_at + 3) = Turning(frame, past_node).transpose() * way;
    row.segment<3>(foot_at) = -way;
    row.segment<2>(foot_at + 3) = -Turning(foot_frame, foot_past_node).transpose() * way;
    return row;
  }

  const LumenPlace& place;
  Eigen::Index point_at;  // first unknowns of the curve with the point
  Eigen::Index foot_at;   // same, of the curve with the foot
  Frame frame;
  Frame foot_frame;
  Vector3d past_node;          // from the distal node of the point's segment
  Vector3d along;              // tangent at the foot
  bool foot_is_fixed = false;  // on the faced segment, since the place lies too far behind it
  Vector3d foot_past_node;     // from the distal node of the faced segment
  double foot_mm;              // past the proximal node of the faced segment
  Vector3d across;
  double offset_mm;
};

// Terms of (43) by the way that the foot slides and turns.
Matrix Sideways(const Pressed& at, double force_N, const Vector3d& normal) {
  if (at.foot_is_fixed) {
    const Vector onto = at.Follow(normal);
    Matrix out = -onto * onto.transpose();
    for (int d = 0; d < 3; ++d) {
      const Vector way = at.Follow(Vector3d::Unit(d));
      out += way * way.transpose();
    }
    return force_N / at.offset_mm * out;
  }
  const Vector sideways = at.Follow(at.along.cross(normal));
  const Vector onwards = at.Follow(at.along);
  Vector tilt = Vector::Zero();  // of the tangent at the foot, along the normal
  tilt.segment<2>(at.foot_at + 3) = Turning(at.foot_frame, at.along).transpose() * normal;
  Matrix out = (force_N / at.offset_mm) * sideways * sideways.transpose() -
               (force_N * at.offset_mm) * tilt * tilt.transpose();
  const Matrix turned = force_N * tilt * onwards.transpose();
  out -= turned + turned.transpose();
  return out;
}

// Second-order terms of (43).
void Bend(const Pressed& at, double force_N, const Vector3d& normal, Matrix& out) {
  out = Sideways(at, force_N, normal);
  // A vector r that turns by phi also moves by (phi (phi.r) - r |phi|^2)/2.
  const auto add = [&](const Frame& frame, const Vector3d& r, double sign, Eigen::Index at_row) {
    const Eigen::Vector2d by_normal(frame.col(1).dot(normal), -frame.col(0).dot(normal));
    const Eigen::Vector2d by_r(frame.col(1).dot(r), -frame.col(0).dot(r));
    Eigen::Matrix2d work = by_normal * by_r.transpose();
    work = (work + work.transpose().eval()) / 2;
    work.diagonal().array() -= normal.dot(r);
    out.block<2, 2>(at_row, at_row) += sign * force_N * work;
  };
  add(at.frame, at.past_node, 1, at.point_at + 3);
  add(at.foot_frame, at.foot_past_node, -1, at.foot_at + 3);
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
    half += gradient[0] * turned(axis) * at.FollowNode(axis).transpose();
  }
  half -=
      gradient[1] * turned(around) * (at.FollowNode(at.along) + turned(at.across) / 2).transpose();
  const double on_outer = gradient[0] * at.foot_past_end_mm / 2;
  const double on_inner =
      at.past_end_mm * at.inward.dot(gradient[0] * at.along + gradient[1] * around) / 2;
  for (Eigen::Index a = 3; a < 5; ++a) {
    half(kOuter + a, kOuter + a) -= on_outer;
    half(kInner + a, kInner + a) -= on_inner;
  }
  return half + half.transpose();
}

// Angle from the first normal of a segment to that of an instrument that twists.
double TurnOf(const Curve& curve, std::size_t segment, int instrument) {
  if (curve.turns_rad().empty()) return 0;
  return curve.turns_rad()[segment][static_cast<std::size_t>(instrument)];
}

// First normal of the lumen.
Vector3d LumenNormal(const Beside& at) {
  const Curve& curve = at.outer.curve;
  return TurnedAbout(at.along, curve.normals()[at.m], TurnOf(curve, at.m, at.place.outer));
}

LumenContact ContactAt(const Beside& at) {
  LumenContact contact;
  contact.inner = at.place.inner;
  contact.outer = at.place.outer;
  contact.outer_from_tip = at.outer.curve.segments() - 1 - at.place.outer_segment;
  contact.lever_mm = at.place.lever_mm;
  contact.lumen_mm = at.place.lumen_mm;
  contact.ahead_mm = at.place.ahead_mm + at.foot_mm;
  const Vector3d normal = LumenNormal(at);
  const Vector3d second_normal = at.along.cross(normal);
  const Eigen::Vector2d& bulge_mm = at.place.lumen_bulge_mm;
  contact.offset_mm << at.across.dot(normal) + bulge_mm[0],
      at.across.dot(second_normal) + bulge_mm[1];
  const Vector3d& inner_normal = at.inner.curve.normals()[at.i];
  contact.turn_rad = std::atan2(inner_normal.dot(second_normal), inner_normal.dot(normal)) +
                     TurnOf(at.inner.curve, at.i, contact.inner);
  return contact;
}

}  // namespace

void BetweenCurves::Reserve(const LumenPairs& pairs) {
  inner = pairs.inner;
  outer = pairs.outer;
  beside = pairs.beside;
  ordered = pairs.ordered;
  groups.reserve(pairs.groups.capacity());
  springs.reserve(pairs.places.capacity());
  if (pairs.beside) neighbors.reserve(pairs.places.capacity());
  slides.reserve(pairs.spots.capacity());
  terms.reserve(pairs.groups.capacity());
  spin_terms.reserve(pairs.groups.capacity());
}

namespace {

// Adds the contacts at the spots of a pair. Their index is the number of their piece.
void AddContacts(const LumenPairs& pairs, const Geometry& inner, const Geometry& outer,
                 std::vector<LumenContact>& contacts) {
  for (const LumenPlace& spot : pairs.spots) {
    contacts.resize(static_cast<std::size_t>(spot.piece) + 1);
    contacts.back() = ContactAt(Beside(spot, inner, outer));
  }
}

}  // namespace

void BetweenCurves::Place(const LumenPairs& pairs, double stiffness_N_mm2,
                          const Geometry& inner_curve, const Geometry& outer_curve,
                          std::vector<LumenContact>* lumen) {
  at_mouth = pairs.at_mouth;
  groups = pairs.groups;
  springs.clear();
  slides.clear();
  neighbors.clear();
  spin_terms.clear();
  energy_mJ = pressed_N = end_pressed_N = largest_offset_mm = 0;
  terms.resize(groups.size());
  if (lumen != nullptr) AddContacts(pairs, inner_curve, outer_curve, *lumen);
  for (const LumenPlace& place : pairs.places) {
    const Pressed at(place, inner_curve, outer_curve);
    largest_offset_mm = std::max(largest_offset_mm, at.offset_mm);
    if (beside) {
      neighbors.push_back(
          {place.group, place.past_mm, at.foot_mm, at.offset_mm, place.lumen_mm - place.lever_mm});
    }
    const double penetration_mm = at.penetration_mm();
    if (penetration_mm < -kNearLumenMm || !(at.offset_mm > kNoOffsetMm)) continue;
    Spring& spring = springs.emplace_back();
    spring.group = place.group;
    spring.past_mm = place.is_mouth ? at.foot_mm : place.past_mm;
    spring.foot_mm = place.is_mouth ? place.foot_mm : at.foot_mm;
    spring.stiffness_N_mm = stiffness_N_mm2 * place.weight_mm;
    spring.penetration_mm = penetration_mm;
    const Vector3d normal = at.across / at.offset_mm;
    spring.approach = at.sign() * at.Follow(normal);
    if (penetration_mm <= 0) continue;
    const double force_N = spring.stiffness_N_mm * penetration_mm;
    energy_mJ += force_N * penetration_mm / 2;
    pressed_N += force_N;
    if (&place == &pairs.places.back()) end_pressed_N += force_N;
    if (lumen != nullptr && !pairs.spots.empty()) {
      const int piece =
          std::clamp(place.piece, pairs.spots.front().piece, pairs.spots.back().piece);
      (*lumen)[static_cast<std::size_t>(piece)].force_N += force_N;
    }
    Bend(at, at.sign() * force_N, normal, spring.curvature);
  }
}

void BetweenCurves::TakeSlides(const LumenPairs& pairs, const Geometry& inner_curve,
                               const Geometry& outer_curve, const std::vector<LumenContact>& lumen,
                               const std::vector<SlideLoad>& loads) {
  slides.clear();
  const bool twists = inner_curve.rod.stack_twists();
  if (twists && !loads.empty()) spin_terms.resize(terms.size());
  for (SpinTerms& term : spin_terms) term.any = false;
  auto spot = pairs.spots.begin();
  for (const SlideLoad& load : loads) {
    while (spot != pairs.spots.end() && spot->piece < load.place) ++spot;
    if (spot == pairs.spots.end()) break;
    if (spot->piece != load.place) continue;
    const LumenContact& contact = lumen[static_cast<std::size_t>(load.place)];
    const LumenPlace& place = *spot;
    const Beside at(place, inner_curve, outer_curve);
    Slide& slide = slides.emplace_back();
    slide.load = load;
    slide.group = place.group;
    slide.past_mm = place.past_mm;
    slide.foot_mm = at.foot_mm;
    slide.inner = place.inner;
    slide.outer = place.outer;
    slide.along = at.FollowNode(at.along);
    at.TurnOuter(at.across, slide.along);
    // (47)
    const Vector3d normal = LumenNormal(at);
    const Vector3d around = load.around[0] * normal + load.around[1] * at.along.cross(normal);
    slide.around = at.Follow(around);
    const Vector3d& inner_normal = inner_curve.curve.normals()[at.i];
    const double inclined = at.along.dot(inner_normal);
    const Vector3d about =
        contact.lever_mm / (1 - inclined * inclined) * at.along.cross(inner_normal);
    at.TurnInner(-about.dot(at.inward) * inner_normal, slide.around);
    at.TurnOuter(-inclined * about, slide.around);
    slide.curvature = Curvature(at, load.gradient, around);
    slide.inner_spin_mm = contact.lever_mm;
    slide.outer_spin_mm = -contact.lever_mm - at.across.dot(around.cross(at.along));
    if (twists) AddSpins(slide);
  }
}

BetweenCurves::Terms& BetweenCurves::TermsOf(int group) {
  Terms& to = terms[static_cast<std::size_t>(group)];
  if (to.any) return to;
  to.any = true;
  to.gradient.setZero();
  to.force.setZero();
  to.hessian.setZero();
  return to;
}

void BetweenCurves::Add(const Spring& spring) {
  Terms& to = TermsOf(spring.group);
  const Vector gradient = (spring.stiffness_N_mm * spring.penetration_mm) * spring.approach;
  to.gradient += gradient;
  to.hessian += spring.stiffness_N_mm * spring.approach * spring.approach.transpose();
  if (!(spring.penetration_mm > 0)) return;
  to.force += gradient;
  to.hessian += spring.curvature;
}

void BetweenCurves::Add(const Slide& slide) {
  Terms& to = TermsOf(slide.group);
  const Eigen::Matrix2d& h = slide.load.hessian;
  const Vector gradient =
      slide.load.gradient[0] * slide.along + slide.load.gradient[1] * slide.around;
  to.gradient += gradient;
  to.force += gradient;
  const Vector with_along = h(0, 0) * slide.along + h(0, 1) * slide.around;
  const Vector with_around = h(1, 0) * slide.along + h(1, 1) * slide.around;
  to.hessian += slide.along * with_along.transpose() + slide.around * with_around.transpose() +
                slide.curvature;
}

void BetweenCurves::AddSpins(const Slide& slide) {
  SpinTerms& to = spin_terms[static_cast<std::size_t>(slide.group)];
  if (!to.any) {
    to.any = true;
    to.with_steps.setZero();
    to.hessian.setZero();
  }
  const Eigen::Matrix2d& h = slide.load.hessian;
  const Vector with = h(1, 0) * slide.along + h(1, 1) * slide.around;
  const int spins[2] = {slide.inner, slide.outer};
  const double by[2] = {slide.inner_spin_mm, slide.outer_spin_mm};
  for (int a = 0; a < 2; ++a) {
    to.with_steps.row(spins[a]) += by[a] * with.transpose();
    for (int b = 0; b < 2; ++b) to.hessian(spins[a], spins[b]) += by[a] * by[b] * h(1, 1);
  }
}

}  // namespace torquer
