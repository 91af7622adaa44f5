// Pairs of curves beside each other.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "host/simulator/core/stack/lumen_pairs.h"
#include "host/simulator/core/stack/pair_builder.h"
#include "host/simulator/core/stack/pair_order.h"

namespace torquer {

using Eigen::Vector3d;

namespace {

// Distance of the axes, mm, up to which a place is paired: one part of the motion covers less.
constexpr double kReachMm = 5;
// Least cosine of the angle between both tangents: instruments that meet head on are not paired.
constexpr double kLeastCosine = -0.5;

// Segment of a curve, `from` or one beyond it, that faces a point; -1 if none is within reach.
int FacingSegment(const WireModel& rod, const Curve& curve, const Vector3d& point, int from) {
  const double longest_mm = 1.5 * rod.segment_mm();
  int m = from;
  while (m < curve.segments()) {
    const auto at = static_cast<std::size_t>(m);
    const double distance_mm = (point - curve.nodes()[at]).norm();
    // No point of the skipped segments can be within reach.
    const int beyond_reach = static_cast<int>((distance_mm - kReachMm) / longest_mm);
    if (beyond_reach > 1) {
      m += beyond_reach - 1;
      continue;
    }
    while (m + 1 < curve.segments()) {
      const auto next = static_cast<std::size_t>(m) + 1;
      if ((point - curve.nodes()[next]).dot(curve.tangents()[next - 1] + curve.tangents()[next]) <
          0) {
        break;
      }
      ++m;
    }
    const auto facing = static_cast<std::size_t>(m);
    const double length_mm = curve.SegmentLength(rod, m);
    const double foot_mm =
        std::clamp(curve.tangents()[facing].dot(point - curve.nodes()[facing]), 0.0, length_mm);
    const Vector3d foot = curve.nodes()[facing] + foot_mm * curve.tangents()[facing];
    if ((point - foot).norm() <= kReachMm) return m;
    ++m;
  }
  return -1;
}

// Line of a segment.
struct Line {
  Vector3d begin;
  Vector3d along;
};

Line LineOf(const Curve& curve, int segment) {
  const auto i = static_cast<std::size_t>(segment);
  return {curve.nodes()[i], curve.tangents()[i]};
}

// Place on a piece of the inner line for contact with the outer line: the middle of the piece if
// the lines run alongside, and the point nearest to the outer line if they cross.
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

void CurvePairs::FindBeside(const InstrumentStack& stack, const WireState& state,
                            LumenPairs& out) const {
  const Curve& inner = state.curve(out.inner);
  const Curve& outer = state.curve(out.outer);
  PairBuilder add{stack, state.poses(), stack.rod(out.inner), stack.rod(out.outer),
                  inner, outer,         with_spots_,          out};
  const double length_mm = outer.ArcLength(add.outer_rod);
  int facing = 0;
  for (int i = 0; i < inner.segments(); ++i) {
    const Line line = LineOf(inner, i);
    const double piece_mm = inner.SegmentLength(add.inner_rod, i) / out.pieces_per_segment;
    for (int k = 0; k < out.pieces_per_segment; ++k) {
      const double middle_mm = (k + 0.5) * piece_mm;
      const int m =
          FacingSegment(add.outer_rod, outer, line.begin + middle_mm * line.along, facing);
      if (m < 0) continue;
      facing = m;
      const Line faced = LineOf(outer, m);
      if (line.along.dot(faced.along) < kLeastCosine) continue;
      const double past_mm = ContactMm(line, faced, middle_mm, piece_mm);
      const double foot_mm = faced.along.dot(line.begin + past_mm * line.along - faced.begin);
      const double segment_mm = outer.SegmentLength(add.outer_rod, m);
      if (foot_mm < -segment_mm || foot_mm > 2 * segment_mm) continue;
      const double foot_arc_mm = ArcMm(add.outer_rod, outer, m) + foot_mm;
      const double covered = CoveredFraction(foot_arc_mm, length_mm, piece_mm);
      if (covered == 0 || LumenOf(stack, out.inner, ArcMm(add.inner_rod, inner, i) + past_mm) !=
                              LumenOf(stack, out.outer, foot_arc_mm)) {
        continue;
      }
      add.AddBeside(i, past_mm, m, covered * piece_mm, i * out.pieces_per_segment + k);
    }
  }
}

// Moves a group of curves beside each other to other segments.
void CurvePairs::MoveGroup(const InstrumentStack& stack, const WireState& state,
                           const SegmentPair& on, int group, LumenPairs& pairs) const {
  PairBuilder builder{stack,
                      state.poses(),
                      stack.rod(pairs.inner),
                      stack.rod(pairs.outer),
                      state.curve(pairs.inner),
                      state.curve(pairs.outer),
                      with_spots_,
                      pairs};
  pairs.groups[static_cast<std::size_t>(group)] = on;
  for (std::vector<LumenPlace>* const places : {&pairs.places, &pairs.spots}) {
    for (LumenPlace& place : *places) {
      if (place.group == group) place = builder.Moved(place, on);
    }
  }
}

// Three curves that face each other may contradict each other in the order of their segments, by
// the small angles between the planes of their nodes. Then the places beside each other take the
// segments before, whose lines run on beyond their ends.
void CurvePairs::OrderBeside(const InstrumentStack& stack, const WireState& state) {
  if (std::none_of(pairs_.begin(), pairs_.end(),
                   [](const LumenPairs& pairs) { return pairs.beside; })) {
    return;
  }
  std::array<int, kMostInstruments> cuts = {};
  for (int c = 0; c < curves_; ++c) {
    cuts[static_cast<std::size_t>(c)] = state.curve(c).segments();
  }
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    left_[k] = static_cast<int>(pairs_[k].groups.size());
  }
  for (std::size_t k = NextPair(pairs_, left_); k < pairs_.size(); k = NextPair(pairs_, left_)) {
    LumenPairs& pairs = pairs_[k];
    const int group = --left_[k];
    int& inner_cut = cuts[static_cast<std::size_t>(pairs.inner)];
    int& outer_cut = cuts[static_cast<std::size_t>(pairs.outer)];
    const SegmentPair& on = pairs.groups[static_cast<std::size_t>(group)];
    const SegmentPair reached{std::min(on.inner, inner_cut - 1), std::min(on.outer, outer_cut - 1)};
    if (reached.inner < on.inner || reached.outer < on.outer) {
      MoveGroup(stack, state, reached, group, pairs);
    }
    inner_cut = reached.inner + 1;
    outer_cut = reached.outer + 1;
  }
}

}  // namespace torquer
