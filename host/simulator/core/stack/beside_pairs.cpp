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

}  // namespace

void CurvePairs::FindBeside(const CombinedRods& rods, const WireState& state,
                            LumenPairs& out) const {
  const Curve& inner = state.curve(out.inner);
  const Curve& outer = state.curve(out.outer);
  PairBuilder add{rods.stack(), state.poses(), rods[out.inner], rods[out.outer],
                  inner,        outer,         with_spots_,     out};
  int facing = 0;
  for (int i = 0; i < inner.segments(); ++i) {
    for (int k = 0; k < out.pieces_per_segment; ++k) {
      const int m = FacingSegment(add.outer_rod, outer, add.MiddleOf(i, k), facing);
      if (m < 0) continue;
      facing = m;
      if (IsHeadOn(inner, i, outer, m)) continue;
      const BesidePlace place = add.FindBeside(i, k, m);
      if (place.covered == 0 || !ShareLumen(rods.stack(), out, place)) continue;
      add.AddBeside(i, place.past_mm, m, place.weight_mm, i * out.pieces_per_segment + k);
    }
  }
}

// True if both ends of a place lie in the same lumen, or both in the vessel.
bool CurvePairs::ShareLumen(const InstrumentStack& stack, const LumenPairs& pairs,
                            const BesidePlace& place) const {
  return LumenOf(stack, pairs.inner, place.arc_mm) ==
         LumenOf(stack, pairs.outer, place.foot_arc_mm);
}

// Moves a group of curves beside each other to other segments.
void CurvePairs::MoveGroup(const CombinedRods& rods, const WireState& state, const SegmentPair& on,
                           int group, LumenPairs& pairs) const {
  PairBuilder builder{rods.stack(),
                      state.poses(),
                      rods[pairs.inner],
                      rods[pairs.outer],
                      state.curve(pairs.inner),
                      state.curve(pairs.outer),
                      with_spots_,
                      pairs};
  pairs.groups[group] = on;
  for (std::vector<LumenPlace>* const places : {&pairs.places, &pairs.spots}) {
    for (LumenPlace& place : *places) {
      if (place.group == group) place = builder.Moved(place, on);
    }
  }
}

// For three curves that face each other, the orders of the pairs may be contradictory. The cause is
// small angles between the planes of their nodes. Then the places beside each other take the
// segments before, whose lines run on beyond their ends.
void CurvePairs::OrderBeside(const CombinedRods& rods, const WireState& state) {
  if (std::none_of(pairs_.begin(), pairs_.end(),
                   [](const LumenPairs& pairs) { return pairs.beside && pairs.ordered; })) {
    return;
  }
  std::array<int, kMostInstruments> cuts = {};
  for (int c = 0; c < curves_; ++c) {
    cuts[c] = state.curve(c).segments();
  }
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    left_[k] = pairs_[k].ordered ? static_cast<int>(pairs_[k].groups.size()) : 0;
  }
  for (std::size_t k = NextPair(pairs_, left_); k < pairs_.size(); k = NextPair(pairs_, left_)) {
    LumenPairs& pairs = pairs_[k];
    const int group = --left_[k];
    int& inner_cut = cuts[pairs.inner];
    int& outer_cut = cuts[pairs.outer];
    const SegmentPair& on = pairs.groups[group];
    const SegmentPair reached{std::min(on.inner, inner_cut - 1), std::min(on.outer, outer_cut - 1)};
    if (reached.inner < on.inner || reached.outer < on.outer) {
      MoveGroup(rods, state, reached, group, pairs);
    }
    inner_cut = reached.inner + 1;
    outer_cut = reached.outer + 1;
  }
}

}  // namespace torquer
