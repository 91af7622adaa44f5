#include "host/simulator/core/stack/pair_builder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace torquer {

using Eigen::Vector3d;

namespace {

constexpr double kShortestMm = 1e-9;  // shorter pieces have no place

// Curvature of the smooth curve through the nodes, at a segment, in its normals, 1/mm.
Eigen::Vector2d CurvatureAt(const WireModel& rod, const Curve& curve, int segment) {
  constexpr double kMostBendRad = 0.5;  // of a segment; a chord cannot represent a sharper bend
  const Vector3d& tangent = curve.tangents()[segment];
  const Vector3d& before = segment == 0 ? rod.sheath().direction : curve.tangents()[segment - 1];
  Vector3d curvature = (tangent - before) / JointLength(rod, curve, segment);
  if (segment + 1 < curve.segments()) {
    const Vector3d beyond =
        (curve.tangents()[segment + 1] - tangent) / JointLength(rod, curve, segment + 1);
    curvature = (curvature + beyond) / 2;
  }
  const Vector3d& normal = curve.normals()[segment];
  Eigen::Vector2d across(curvature.dot(normal), curvature.dot(tangent.cross(normal)));
  const double bend_rad = across.norm() * curve.SegmentLength(rod, segment);
  return bend_rad > kMostBendRad ? Eigen::Vector2d(kMostBendRad / bend_rad * across) : across;
}

// Line of a segment.
struct Line {
  Vector3d begin;
  Vector3d along;
};

Line LineOf(const Curve& curve, int segment) {
  return {curve.nodes()[segment], curve.tangents()[segment]};
}

// Place on a piece of the inner line for contact with the outer line. If the lines run alongside,
// it is the middle of the piece. If they cross, it is the point nearest to the outer line.
double ContactMm(const Line& inner, const Line& outer, double middle_mm, double piece_mm) {
  constexpr double kAlongside = 0.15;  // sines of the angle
  constexpr double kCrossing = 0.45;
  const double cosine = inner.along.dot(outer.along);
  const double squared_sine = 1 - cosine * cosine;
  const double fraction = std::clamp(
      (std::sqrt(std::max(0.0, squared_sine)) - kAlongside) / (kCrossing - kAlongside), 0.0, 1.0);
  if (fraction == 0) return middle_mm;
  const Vector3d apart = inner.begin + middle_mm * inner.along - outer.begin;
  const double nearest_mm =
      (cosine * outer.along.dot(apart) - inner.along.dot(apart)) / squared_sine;
  return middle_mm + fraction * std::clamp(nearest_mm, -piece_mm / 2, piece_mm / 2);
}

// Part of a piece around a foot that a curve of a length covers.
double CoveredFraction(double foot_mm, double length_mm, double piece_mm) {
  return std::clamp(foot_mm / piece_mm + 0.5, 0.0, 1.0) *
         std::clamp((length_mm - foot_mm) / piece_mm + 0.5, 0.0, 1.0);
}

}  // namespace

bool IsHeadOn(const Curve& inner, int segment, const Curve& outer, int outer_segment) {
  constexpr double kLeastCosine = -0.1;  // so wires at a right angle stay in order
  return inner.tangents()[segment].dot(outer.tangents()[outer_segment]) < kLeastCosine;
}

double ArcMm(const WireModel& rod, const Curve& curve, int segment) {
  return segment == 0 ? 0 : curve.first_segment_mm() + (segment - 1) * rod.segment_mm();
}

const Eigen::Vector2d& PairBuilder::InnerCurvature(int segment) {
  if (last_inner.segment != segment) {
    last_inner = {segment, CurvatureAt(inner_rod, inner, segment)};
  }
  return last_inner.curvature;
}

const Eigen::Vector2d& PairBuilder::OuterCurvature(int segment) {
  if (last_outer.segment != segment) {
    last_outer = {segment, CurvatureAt(outer_rod, outer, segment)};
  }
  return last_outer.curvature;
}

LumenPlace PairBuilder::PlaceAt(int segment, double past_mm, int outer_segment, double weight_mm) {
  LumenPlace place = Make(segment, past_mm, outer_segment, weight_mm);
  place.group = GroupOf(segment, outer_segment);
  return place;
}

// The group of two segments, which is new unless it is the last, or one of the same inner segment.
int PairBuilder::GroupOf(int segment, int outer_segment) {
  int group = static_cast<int>(out.groups.size()) - 1;
  for (; group >= 0; --group) {
    const SegmentPair& on = out.groups[group];
    if (on.inner == segment && on.outer == outer_segment) return group;
    if (out.ordered || on.inner != segment) break;
  }
  out.groups.push_back({segment, outer_segment});
  return static_cast<int>(out.groups.size()) - 1;
}

Vector3d PairBuilder::MiddleOf(int segment, int k) const {
  const Line line = LineOf(inner, segment);
  const double piece_mm = inner.SegmentLength(inner_rod, segment) / out.pieces_per_segment;
  const double middle_mm = (k + 0.5) * piece_mm;
  return line.begin + middle_mm * line.along;
}

BesidePlace PairBuilder::FindBeside(int segment, int k, int outer_segment) const {
  const Line line = LineOf(inner, segment);
  const Line faced = LineOf(outer, outer_segment);
  const double piece_mm = inner.SegmentLength(inner_rod, segment) / out.pieces_per_segment;
  BesidePlace place;
  place.past_mm = ContactMm(line, faced, (k + 0.5) * piece_mm, piece_mm);
  const double foot_mm = faced.along.dot(line.begin + place.past_mm * line.along - faced.begin);
  const double segment_mm = outer.SegmentLength(outer_rod, outer_segment);
  if (foot_mm < -segment_mm || foot_mm > 2 * segment_mm) return place;
  place.arc_mm = ArcMm(inner_rod, inner, segment) + place.past_mm;
  place.foot_arc_mm = ArcMm(outer_rod, outer, outer_segment) + foot_mm;
  // A curve that turns back at the mouth touches no outside there yet.
  const double covers_mm = outer.ArcLength(outer_rod) - (out.turned_back ? piece_mm / 2 : 0);
  place.covered = CoveredFraction(place.foot_arc_mm, covers_mm, piece_mm);
  place.weight_mm = place.covered * piece_mm;
  return place;
}

LumenPlace PairBuilder::Make(int segment, double past_mm, int outer_segment, double weight_mm) {
  const Vector3d at = inner.nodes()[segment] + past_mm * inner.tangents()[segment];
  const auto m = static_cast<std::size_t>(outer_segment);
  const double foot_mm = outer.tangents()[m].dot(at - outer.nodes()[m]);
  const double arc_mm = ArcMm(inner_rod, inner, segment) + past_mm;
  const double outer_begin_mm = ArcMm(outer_rod, outer, outer_segment);
  LumenPlace place;
  place.segment = segment;
  place.outer_segment = outer_segment;
  place.inner = stack.SurfaceAt(out.inner, poses, arc_mm);
  place.outer = out.beside ? stack.SurfaceAt(out.outer, poses, outer_begin_mm + foot_mm)
                           : stack.LumenAt(out.outer, poses, outer_begin_mm + foot_mm);
  place.past_mm = past_mm;
  place.foot_mm = foot_mm;
  place.weight_mm = weight_mm;
  place.piece = PieceOf(segment, past_mm);
  const double radius_mm = inner_rod.radius_mm(inner.segments() - 1 - segment);
  place.lever_mm = out.beside ? -radius_mm : radius_mm;
  place.lumen_mm = out.beside ? outer_rod.radius_mm(outer.segments() - 1 - outer_segment)
                              : stack.clearance().lumen_radius_mm[place.outer];
  place.ahead_mm =
      poses[place.inner].insertion_mm - arc_mm - (poses[place.outer].insertion_mm - outer_begin_mm);
  // A circle through the ends of a chord is beside it by kappa t (l - t) / 2.
  const double length_mm = inner.SegmentLength(inner_rod, segment);
  const double outer_mm = outer.SegmentLength(outer_rod, outer_segment);
  const Eigen::Vector2d& bend = OuterCurvature(outer_segment);
  const double foot_on_mm = std::clamp(foot_mm, 0.0, outer_mm);
  place.bulge_mm = -past_mm * (length_mm - past_mm) / 2 * InnerCurvature(segment);
  place.foot_bulge_mm = -foot_on_mm * (outer_mm - foot_on_mm) / 2 * bend;
  place.foot_slope = (foot_on_mm - outer_mm / 2) * bend;
  if (out.inner == out.outer) place.ForgetBulges();
  return place;
}

Eigen::Vector2d PairBuilder::LumenBulge(const LumenPlace& place) const {
  const int i = place.segment;
  const int m = place.outer_segment;
  const Vector3d& normal = inner.normals()[i];
  const Vector3d& along = outer.tangents()[m];
  const Vector3d first = outer.SurfaceNormal(m, place.outer);
  const Vector3d bulge_mm = place.bulge_mm[0] * normal +
                            place.bulge_mm[1] * inner.tangents()[i].cross(normal) -
                            place.foot_bulge_mm[0] * outer.normals()[m] -
                            place.foot_bulge_mm[1] * along.cross(outer.normals()[m]);
  return {bulge_mm.dot(first), bulge_mm.dot(along.cross(first))};
}

int PairBuilder::PieceOf(int segment, double past_mm) const {
  const double piece_mm = inner.SegmentLength(inner_rod, segment) / out.pieces_per_segment;
  const int piece = std::min(static_cast<int>(past_mm / piece_mm), out.pieces_per_segment - 1);
  return segment * out.pieces_per_segment + piece;
}

void PairBuilder::AddBeside(int segment, double past_mm, int outer_segment, double weight_mm,
                            int piece) {
  LumenPlace& place = out.places.emplace_back(PlaceAt(segment, past_mm, outer_segment, weight_mm));
  place.piece = piece;
  if (with_spots) AddSpotBeside();
}

void PairBuilder::AddSpotBeside() {
  LumenPlace& place = out.places.back();
  if (!out.ordered) {
    const Line line = LineOf(inner, place.segment);
    const Line faced = LineOf(outer, place.outer_segment);
    const Vector3d apart = line.begin + place.past_mm * line.along - faced.begin;
    const double piece_mm = inner_rod.segment_mm() / out.pieces_per_segment;
    const double distance_mm = apart.cross(faced.along).norm();
    if (distance_mm > place.lumen_mm - place.lever_mm + piece_mm) return;
    if (out.spots.size() == out.spots.capacity()) return;  // as with places
  }
  place.lumen_bulge_mm = LumenBulge(place);
  out.spots.push_back(place);
}

LumenPlace PairBuilder::Moved(const LumenPlace& place, const SegmentPair& on) {
  double past_mm = place.past_mm;
  for (int i = on.inner; i < place.segment; ++i) past_mm += inner.SegmentLength(inner_rod, i);
  LumenPlace moved = Make(on.inner, past_mm, on.outer, place.weight_mm);
  moved.group = place.group;
  moved.piece = place.piece;
  if (with_spots) moved.lumen_bulge_mm = LumenBulge(moved);
  return moved;
}

void PairBuilder::AddPiece(int segment, double from_mm, double to_mm, int outer_segment) {
  const double length_mm = to_mm - from_mm;
  if (length_mm > kShortestMm) {
    constexpr double kRounding = 1e-9;
    const double pieces = length_mm * out.pieces_per_segment / inner_rod.segment_mm();
    const int count = std::max(1, static_cast<int>(std::ceil(pieces - kRounding)));
    for (int k = 0; k < count; ++k) {
      out.places.push_back(PlaceAt(segment, from_mm + (k + 0.5) * length_mm / count, outer_segment,
                                   length_mm / count));
    }
  }
  if (!with_spots) return;
  const double piece_mm = inner.SegmentLength(inner_rod, segment) / out.pieces_per_segment;
  for (int k = 0; k < out.pieces_per_segment; ++k) {
    const double past_mm = (k + 0.5) * piece_mm;
    if (past_mm < from_mm || past_mm >= to_mm) continue;
    LumenPlace& spot = out.spots.emplace_back(PlaceAt(segment, past_mm, outer_segment, piece_mm));
    spot.lumen_bulge_mm = LumenBulge(spot);
  }
}

void PairBuilder::AddTip(int outer_segment) {
  const int segment = inner.segments() - 1;
  LumenPlace place = PlaceAt(segment, inner.SegmentLength(inner_rod, segment), outer_segment, 0);
  place.weight_mm = place.lumen_mm;
  out.places.push_back(place);
}

void PairBuilder::AddMouth(int segment, double past_mm) {
  LumenPlace place = PlaceAt(segment, past_mm, outer.segments() - 1, 0);
  place.weight_mm = place.lumen_mm;
  place.is_mouth = true;
  place.foot_bulge_mm = place.bulge_mm;
  place.bulge_mm.setZero();
  place.foot_slope =
      (past_mm - inner.SegmentLength(inner_rod, segment) / 2) * InnerCurvature(segment);
  out.places.push_back(place);
}

}  // namespace torquer
