// Relative sliding of the surfaces of two curves, and the terms of friction between them.
#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "host/simulator/core/stack/between_curves.h"
#include "host/simulator/core/stack/pair_builder.h"
#include "host/simulator/core/stack/turning.h"

namespace torquer {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using StepRow = BetweenCurves::Vector;
using StepMatrix = BetweenCurves::Matrix;
using CurveGeometry = BetweenCurves::Geometry;

namespace {

// First unknowns of each curve in a StepRow.
constexpr Eigen::Index kInnerSteps = 0;
constexpr Eigen::Index kOuterSteps = 5;

// Place on the inner curve with its foot on the line of the outer segment, both as chords. The
// bulges do not change how the surfaces slide.
struct AxisPlace {
  AxisPlace(const LumenPlace& of, const CurveGeometry& inner_curve,
            const CurveGeometry& outer_curve)
      : place(of),
        i(of.segment),
        m(of.outer_segment),
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
  StepRow Follow(const Vector3d& way) const { return Follow(way, foot_past_end_mm); }
  // The same against the distal node of the outer segment.
  StepRow FollowNode(const Vector3d& way) const { return Follow(way, 0); }
  // Adds the component along `way` of the turn of a curve's tangent.
  void TurnInner(const Vector3d& way, StepRow& row) const {
    row.segment<2>(kInnerSteps + 3) += inner.frames[i].transpose() * way;
  }
  void TurnOuter(const Vector3d& way, StepRow& row) const {
    row.segment<2>(kOuterSteps + 3) += outer.frames[m].transpose() * way;
  }

  const LumenPlace& place;
  int i;  // segment of the inner curve
  int m;  // segment of the outer curve
  const CurveGeometry& inner;
  const CurveGeometry& outer;
  const Vector3d& inward;  // tangent of the inner curve
  const Vector3d& along;   // tangent of the outer curve
  Vector3d apart;          // from the proximal node of the outer segment
  double foot_mm;
  Vector3d across;
  double past_end_mm;       // negative: before the distal node of the inner segment
  double foot_past_end_mm;  // same, of the foot on the outer segment

 private:
  StepRow Follow(const Vector3d& way, double outer_past_end_mm) const {
    StepRow row;
    row.segment<3>(kInnerSteps) = way;
    row.segment<2>(kInnerSteps + 3) = past_end_mm * (inner.frames[i].transpose() * way);
    row.segment<3>(kOuterSteps) = -way;
    row.segment<2>(kOuterSteps + 3) = -outer_past_end_mm * (outer.frames[m].transpose() * way);
    return row;
  }
};

// Second derivatives of the work of the force `gradient` along and around the lumen. The turn of
// the inner surface is left out. The directions turn with the lumen, and the steps have
// second-order terms too.
StepMatrix Curvature(const AxisPlace& at, const Eigen::Vector2d& gradient, const Vector3d& around) {
  const auto turned = [&at](const Vector3d& way) {
    StepRow row = StepRow::Zero();
    at.TurnOuter(way, row);
    return row;
  };
  StepMatrix half = StepMatrix::Zero();
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
    half(kOuterSteps + a, kOuterSteps + a) -= on_outer;
    half(kInnerSteps + a, kInnerSteps + a) -= on_inner;
  }
  return half + half.transpose();
}

// Tangent, first and second normal of a surface.
Matrix3d AxesOf(const Curve& curve, int segment, int instrument) {
  const Vector3d& tangent = curve.tangents()[segment];
  const Vector3d normal = curve.SurfaceNormal(segment, instrument);
  Matrix3d axes;
  axes << tangent, normal, tangent.cross(normal);
  return axes;
}

Matrix3d OuterAxes(const AxisPlace& at) { return AxesOf(at.outer.curve, at.m, at.place.outer); }

LumenContact ContactAt(const AxisPlace& at, const LumenPairs& pairs) {
  LumenContact contact;
  contact.pair = pairs.number;
  contact.inner = at.place.inner;
  contact.outer = at.place.outer;
  contact.inner_from_tip =
      at.inner.curve.segments() * pairs.pieces_per_segment - 1 - at.place.piece;
  contact.outer_from_tip = at.outer.curve.segments() - 1 - at.place.outer_segment;
  contact.lever_mm = at.place.lever_mm;
  contact.lumen_mm = at.place.lumen_mm;
  contact.ahead_mm = at.place.ahead_mm + at.foot_mm;
  const Matrix3d axes = OuterAxes(at);
  const Eigen::Vector2d& bulge_mm = at.place.lumen_bulge_mm;
  contact.offset_mm << at.across.dot(axes.col(1)) + bulge_mm[0],
      at.across.dot(axes.col(2)) + bulge_mm[1];
  if (pairs.beside) {
    contact.inner_mm = ArcMm(at.inner.rod, at.inner.curve, at.place.segment) + at.place.past_mm -
                       at.inner.curve.poses()[at.place.inner].insertion_mm;
    contact.inner_axes = axes.transpose() * AxesOf(at.inner.curve, at.i, at.place.inner);
    return contact;
  }
  const Vector3d& inner_normal = at.inner.curve.normals()[at.i];
  contact.turn_rad = std::atan2(inner_normal.dot(axes.col(2)), inner_normal.dot(axes.col(1)));
  if (!at.inner.curve.turns_rad().empty()) {
    contact.turn_rad += at.inner.curve.turns_rad()[at.i][contact.inner];
  }
  return contact;
}

// Derivatives of the sliding in a lumen, (47).
void SlideInLumen(const AxisPlace& at, const LumenContact& contact, BetweenCurves::Slide& slide) {
  slide.along = at.FollowNode(at.along);
  at.TurnOuter(at.across, slide.along);
  const Matrix3d axes = OuterAxes(at);
  const Vector3d around = slide.load.around[0] * axes.col(1) + slide.load.around[1] * axes.col(2);
  slide.around = at.Follow(around);
  const Vector3d& inner_normal = at.inner.curve.normals()[at.i];
  const double inclined = at.along.dot(inner_normal);
  const Vector3d about =
      contact.lever_mm / (1 - inclined * inclined) * at.along.cross(inner_normal);
  at.TurnInner(-about.dot(at.inward) * inner_normal, slide.around);
  at.TurnOuter(-inclined * about, slide.around);
  slide.curvature = Curvature(at, slide.load.gradient, around);
  slide.inner_spin_mm[1] = contact.lever_mm;
  slide.outer_spin_mm[1] = -contact.lever_mm - at.across.dot(around.cross(at.along));
}

// Derivatives of the sliding of curves beside each other, (52).
void SlideBeside(const AxisPlace& at, BetweenCurves::Slide& slide) {
  const Matrix3d axes = OuterAxes(at);
  const Frame& inner_frame = at.inner.frames[at.i];
  const Frame& outer_frame = at.outer.frames[at.m];
  // The point of contact on the inner surface, from the distal nodes of both segments.
  const Vector3d lever = axes * slide.load.lever_mm;
  const Vector3d of_inner = at.past_end_mm * at.inward + lever;
  const Vector3d of_outer = at.foot_past_end_mm * at.along + at.across + lever;
  const Frame inner_turning = Turning(inner_frame, of_inner);
  const Frame outer_turning = Turning(outer_frame, of_outer);
  const auto follow = [&](const Vector3d& way) {
    StepRow row;
    row.segment<3>(kInnerSteps) = way;
    row.segment<2>(kInnerSteps + 3) = inner_turning.transpose() * way;
    row.segment<3>(kOuterSteps) = -way;
    row.segment<2>(kOuterSteps + 3) = -outer_turning.transpose() * way;
    return row;
  };
  const Vector3d around = slide.load.around[0] * axes.col(1) + slide.load.around[1] * axes.col(2);
  slide.along = follow(at.along);
  slide.around = follow(around);
  const auto spin = [&](const Vector3d& axis, const Vector3d& from_axis) {
    const Vector3d moved = axis.cross(from_axis);
    return Eigen::Vector2d(moved.dot(at.along), moved.dot(around));
  };
  slide.inner_spin_mm = spin(at.inward, lever);
  slide.outer_spin_mm = -spin(at.along, of_outer);

  const Vector3d force_N = slide.load.gradient[0] * at.along + slide.load.gradient[1] * around;
  // The directions turn with the outer surface.
  StepMatrix half = StepMatrix::Zero();
  const Frame turned = Turning(outer_frame, force_N);
  for (int d = 0; d < 3; ++d) {
    StepRow moved = StepRow::Zero();
    moved[kInnerSteps + d] = 1;
    moved.segment<2>(kInnerSteps + 3) = inner_turning.row(d).transpose();
    moved[kOuterSteps + d] = -1;
    half.middleRows<2>(kOuterSteps + 3) += turned.row(d).transpose() * moved.transpose();
  }
  // Spins turn the lever after the step, and the directions before it.
  const Vector3d spun = at.inward.cross(lever);
  const Vector3d across_N = at.along.cross(force_N);
  slide.spin_with_steps[0].segment<2>(kInnerSteps + 3) =
      Turning(inner_frame, spun).transpose() * force_N;
  slide.spin_with_steps[0].segment<2>(kOuterSteps + 3) =
      -Turning(outer_frame, spun).transpose() * force_N;
  slide.spin_with_steps[1] = follow(across_N);
  slide.spin_curvature(0, 0) = force_N.dot(at.inward.cross(spun));
  slide.spin_curvature(0, 1) = slide.spin_curvature(1, 0) = spun.dot(across_N);
  slide.spin_curvature(1, 1) = force_N.dot(at.along.cross(at.along.cross(of_outer)));
  slide.curvature = half + half.transpose();
  slide.curvature.block<2, 2>(kInnerSteps + 3, kInnerSteps + 3) +=
      TurningTwice(inner_frame, of_inner, force_N);
  slide.curvature.block<2, 2>(kOuterSteps + 3, kOuterSteps + 3) +=
      TurningTwice(outer_frame, of_outer, force_N);
}

}  // namespace

// Adds the contacts at the spots of a pair. In order, their index is the number of their piece.
void BetweenCurves::AddContacts(const LumenPairs& pairs, const CurveGeometry& inner,
                                const CurveGeometry& outer, std::vector<LumenContact>& contacts) {
  for (const LumenPlace& spot : pairs.spots) {
    const std::size_t size =
        pairs.ordered ? static_cast<std::size_t>(spot.piece) + 1 : contacts.size() + 1;
    contacts.resize(size);
    contacts.back() = ContactAt(AxisPlace(spot, inner, outer), pairs);
  }
}

void BetweenCurves::TakeSlides(const LumenPairs& pairs, const CurveGeometry& inner_curve,
                               const CurveGeometry& outer_curve,
                               const std::vector<LumenContact>& lumen, std::size_t first_contact,
                               const std::vector<SlideLoad>& loads) {
  slides.clear();
  const bool twists = inner_curve.rod.spins() > 0;
  if (twists && !loads.empty()) spin_terms.resize(terms.size());
  for (SpinTerms& term : spin_terms) term.any = false;
  const auto index_of = [&](std::vector<LumenPlace>::const_iterator spot) {
    return pairs.ordered
               ? spot->piece
               : static_cast<int>(first_contact) + static_cast<int>(spot - pairs.spots.begin());
  };
  auto spot = pairs.spots.begin();
  for (const SlideLoad& load : loads) {
    while (spot != pairs.spots.end() && index_of(spot) < load.place) ++spot;
    if (spot == pairs.spots.end()) break;
    if (index_of(spot) != load.place) continue;
    const AxisPlace at(*spot, inner_curve, outer_curve);
    Slide& slide = slides.emplace_back();
    slide.load = load;
    slide.group = spot->group;
    slide.past_mm = spot->past_mm;
    slide.foot_mm = at.foot_mm;
    slide.inner = spot->inner;
    slide.outer = spot->outer;
    if (pairs.beside) {
      SlideBeside(at, slide);
    } else {
      SlideInLumen(at, lumen[load.place], slide);
    }
    if (twists) AddSpins(slide);
  }
}

void BetweenCurves::Add(const Slide& slide) {
  Terms& to = TermsOf(slide.group);
  const Eigen::Matrix2d& h = slide.load.hessian;
  const StepRow gradient =
      slide.load.gradient[0] * slide.along + slide.load.gradient[1] * slide.around;
  to.gradient += gradient;
  to.force += gradient;
  const StepRow with_along = h(0, 0) * slide.along + h(0, 1) * slide.around;
  const StepRow with_around = h(1, 0) * slide.along + h(1, 1) * slide.around;
  to.hessian += slide.along * with_along.transpose() + slide.around * with_around.transpose() +
                slide.curvature;
}

void BetweenCurves::AddSpins(const Slide& slide) {
  SpinTerms& to = spin_terms[slide.group];
  if (!to.any) {
    to.any = true;
    to.surface = {slide.inner, slide.outer};
    to.with_steps.setZero();
    to.hessian.setZero();
  }
  const Eigen::Matrix2d& h = slide.load.hessian;
  const int of[2] = {slide.inner, slide.outer};
  const Eigen::Vector2d by[2] = {slide.inner_spin_mm, slide.outer_spin_mm};
  for (int a = 0; a < 2; ++a) {
    const int row = ordered ? of[a] : a;
    const Eigen::Vector2d force_N = h * by[a];
    if (!ordered && of[a] != to.surface[a]) continue;
    to.with_steps.row(row) +=
        (force_N[0] * slide.along + force_N[1] * slide.around + slide.spin_with_steps[a])
            .transpose();
    for (int b = 0; b < 2; ++b) {
      if (!ordered && of[b] != to.surface[b]) continue;
      to.hessian(row, ordered ? of[b] : b) += by[b].dot(force_N) + slide.spin_curvature(a, b);
    }
  }
}

}  // namespace torquer
