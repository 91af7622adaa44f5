#include "host/simulator/core/stack/between_curves.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "host/simulator/core/stack/pair_builder.h"
#include "host/simulator/core/stack/turning.h"

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

// Point of one curve and the tangent of the other at its foot, both with their bulges. Each is
// fixed to its segment. The point is on the inner curve, but for the mouth.
struct Pressed {
  Pressed(const LumenPlace& of, const Geometry& inner, const Geometry& outer)
      : place(of), point_at(of.is_mouth ? kOuter : kInner), foot_at(of.is_mouth ? kInner : kOuter) {
    const Geometry& own = of.is_mouth ? outer : inner;
    const Geometry& other = of.is_mouth ? inner : outer;
    const int segment = of.is_mouth ? of.outer_segment : of.segment;
    const int faced = of.is_mouth ? of.segment : of.outer_segment;
    frame = own.frames[segment];
    foot_frame = other.frames[faced];
    const double length_mm = own.curve.SegmentLength(own.rod, segment);
    const double faced_mm = other.curve.SegmentLength(other.rod, faced);
    const Vector3d& chord = other.curve.tangents()[faced];
    const double past_end_mm = of.is_mouth ? 0 : of.past_mm - length_mm;
    past_node = past_end_mm * own.curve.tangents()[segment] + frame * of.bulge_mm;
    along = (chord + foot_frame * of.foot_slope).normalized();
    // The foot slides along that tangent.
    const Vector3d begin = ((of.is_mouth ? of.past_mm : of.foot_mm) - faced_mm) * chord +
                           foot_frame * of.foot_bulge_mm;
    const Vector3d apart =
        own.curve.nodes()[segment + 1] + past_node - other.curve.nodes()[faced + 1] - begin;
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
  const auto add = [&](const Frame& frame, const Vector3d& r, double sign, Eigen::Index at_row) {
    out.block<2, 2>(at_row, at_row) += sign * force_N * TurningTwice(frame, r, normal);
  };
  add(at.frame, at.past_node, 1, at.point_at + 3);
  add(at.foot_frame, at.foot_past_node, -1, at.foot_at + 3);
}

}  // namespace

void BetweenCurves::Reserve(const LumenPairs& pairs) {
  inner = pairs.inner;
  outer = pairs.outer;
  beside = pairs.beside;
  turned_back = pairs.turned_back;
  ordered = pairs.ordered;
  groups.reserve(pairs.groups.capacity());
  springs.reserve(pairs.places.capacity());
  if (pairs.beside) neighbors.reserve(pairs.places.capacity());
  slides.reserve(pairs.spots.capacity());
  terms.reserve(pairs.groups.capacity());
  spin_terms.reserve(pairs.groups.capacity());
}

namespace {

// Contact at the spot of a place's piece, or at the nearest one.
LumenContact& ContactAtPiece(const LumenPairs& pairs, const LumenPlace& place,
                             std::vector<LumenContact>& contacts) {
  const int piece = std::clamp(place.piece, pairs.spots.front().piece, pairs.spots.back().piece);
  return contacts[piece];
}

// Contact at the spot of a place of curves that cross, or null without. `spot`: the next one.
LumenContact* ContactAtSpot(const LumenPairs& pairs, const LumenPlace& place,
                            std::vector<LumenPlace>::const_iterator& spot,
                            std::size_t first_contact, std::vector<LumenContact>& contacts) {
  if (spot == pairs.spots.end() || spot->piece != place.piece ||
      spot->outer_segment != place.outer_segment) {
    return nullptr;
  }
  return &contacts[first_contact + static_cast<std::size_t>(spot++ - pairs.spots.begin())];
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
  const std::size_t first_contact = lumen == nullptr ? 0 : lumen->size();
  if (lumen != nullptr) AddContacts(pairs, inner_curve, outer_curve, *lumen);
  auto spot = pairs.spots.begin();  // the next one of curves that cross
  for (const LumenPlace& place : pairs.places) {
    LumenContact* contact = nullptr;
    if (lumen != nullptr && !pairs.spots.empty()) {
      contact = ordered ? &ContactAtPiece(pairs, place, *lumen)
                        : ContactAtSpot(pairs, place, spot, first_contact, *lumen);
    }
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
    if (contact != nullptr) contact->force_N += force_N;
    Bend(at, at.sign() * force_N, normal, spring.curvature);
  }
}

BetweenCurves::Terms& BetweenCurves::TermsOf(int group) {
  Terms& to = terms[group];
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

}  // namespace torquer
