// Pairs of curves that cross. Curves beside each other face each other head on or out of order. A
// curve may also cross itself, or a curve whose lumen it has left.
//
// A place may face several segments, in any order. In a coil, each turn faces the turns around it.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "host/simulator/core/stack/lumen_pairs.h"
#include "host/simulator/core/stack/pair_builder.h"

namespace torquer {

using Eigen::Vector3d;

namespace {

// Segments from a segment of a curve to the first one that can touch it.
constexpr int kApart = 3;
// A curve that has turned by less than a right angle since a place does not face it. All turns are
// added.
constexpr double kLeastTurnRad = 1.5;

// Bound of the angle between two tangents of a curve: an arc is at most pi/2 chords.
double MostTurnRad(const Vector3d& before, const Vector3d& beyond) {
  return M_PI / 2 * (beyond - before).norm();
}

// True if a point faces a segment: beyond the plane of the proximal node, before that of the distal
// one. There the distance to the curve is least.
bool Faces(const Curve& curve, const Vector3d& point, int segment) {
  const std::vector<Vector3d>& tangents = curve.tangents();
  const Vector3d before =
      segment == 0 ? tangents[0] : Vector3d(tangents[segment - 1] + tangents[segment]);
  if ((point - curve.nodes()[segment]).dot(before) < 0) return false;
  if (segment + 1 == curve.segments()) return true;  // its end limits the place
  return (point - curve.nodes()[segment + 1]).dot(tangents[segment] + tangents[segment + 1]) < 0;
}

// Calls take(m) for each segment of a stretch that faces a point within reach.
template <class Take>
void ForEachFacing(const WireModel& rod, const Curve& curve, const Vector3d& point,
                   const SegmentStretch& stretch, Take take) {
  const double longest_mm = 1.5 * rod.segment_mm();
  for (int m = stretch.begin; m < stretch.end; ++m) {
    const Vector3d apart = point - curve.nodes()[m];
    const double beyond_reach_mm = apart.norm() - kReachMm;
    if (beyond_reach_mm > longest_mm) {
      // No point of the skipped segments can be within reach.
      m += static_cast<int>(beyond_reach_mm / longest_mm) - 1;
      continue;
    }
    if (Faces(curve, point, m)) take(m);
  }
}

// Segments of a curve that can face its own earlier places.
class FacingItself {
 public:
  explicit FacingItself(const Curve& curve) : tangents_(curve.tangents()) {}

  // Segments that can face a place of a segment. Segments must ascend one by one.
  SegmentStretch Of(int segment) {
    if (segment > 0 && first_ >= segment) turned_rad_ -= TurnRad(segment - 1);
    first_ = std::max(first_, segment);
    const int last = static_cast<int>(tangents_.size()) - 1;
    while (first_ < last && turned_rad_ + TurnRad(first_) < kLeastTurnRad) {
      turned_rad_ += TurnRad(first_++);
    }
    return {std::max(first_ + 1, segment + kApart), last + 1};
  }

 private:
  double TurnRad(int segment) const {
    return MostTurnRad(tangents_[segment], tangents_[segment + 1]);
  }

  const std::vector<Vector3d>& tangents_;
  int first_ = 0;          // last segment that cannot face the place
  double turned_rad_ = 0;  // from the place's segment to it
};

// Segments of an outer curve that an inner curve can face from outside. It has left the mouth and
// turned back.
class FacingOutside {
 public:
  // `left`: segment of the inner curve at the mouth. The outer curve has segments.
  FacingOutside(const Curve& inner, int left, const Curve& outer)
      : inner_(inner.tangents()), outer_(outer.tangents()), next_(left) {
    turned_rad_ = MostTurnRad(outer_.back(), inner_[left]);
    for (std::size_t m = 0; m + 1 < outer_.size(); ++m) {
      rest_rad_ += MostTurnRad(outer_[m], outer_[m + 1]);
    }
  }

  // Segments that can face a place of a segment beyond the mouth. Segments must ascend.
  SegmentStretch Of(int segment) {
    for (; next_ < segment; ++next_) turned_rad_ += MostTurnRad(inner_[next_], inner_[next_ + 1]);
    const int segments = static_cast<int>(outer_.size());
    while (end_ < segments && turned_rad_ + rest_rad_ >= kLeastTurnRad) {
      if (end_ + 1 < segments) rest_rad_ -= MostTurnRad(outer_[end_], outer_[end_ + 1]);
      ++end_;
    }
    return {0, end_};
  }

 private:
  const std::vector<Vector3d>& inner_;
  const std::vector<Vector3d>& outer_;
  int next_ = 0;           // segment of the inner curve up to which turns are added
  int end_ = 0;            // first segment of the outer curve that cannot be faced
  double turned_rad_ = 0;  // from the mouth to `next_`
  double rest_rad_ = 0;    // from `end_` to the mouth
};

// Segment of a curve at an arc length; its segments beyond the tip.
int SegmentAt(const WireModel& rod, const Curve& curve, double arc_mm) {
  int segment = 0;
  while (segment < curve.segments() && ArcMm(rod, curve, segment + 1) <= arc_mm) ++segment;
  return segment;
}

// Places of curves beside each other that are in order, from the sheath on.
class InOrder {
 public:
  explicit InOrder(const LumenPairs& pairs) : places_(pairs.places) {}

  // True if a piece faces a segment in order, or one next to it. Pieces must ascend.
  bool Faces(int piece, int outer_segment) {
    while (next_ < places_.size() && places_[next_].piece < piece) ++next_;
    return next_ < places_.size() && places_[next_].piece == piece &&
           std::abs(places_[next_].outer_segment - outer_segment) <= 1;
  }

 private:
  const std::vector<LumenPlace>& places_;
  std::size_t next_ = 0;
};

}  // namespace

// Adds the places of a segment that face a stretch of the outer curve, where takes(piece, m).
template <class Takes>
void CurvePairs::AddFacing(int segment, const SegmentStretch& stretch, PairBuilder& add,
                           Takes takes) const {
  if (stretch.begin >= stretch.end) return;
  LumenPairs& out = add.out;
  for (int k = 0; k < out.pieces_per_segment; ++k) {
    const int piece = segment * out.pieces_per_segment + k;
    ForEachFacing(add.outer_rod, add.outer, add.MiddleOf(segment, k), stretch, [&](int m) {
      if (!takes(piece, m)) return;
      const BesidePlace place = add.FindBeside(segment, k, m);
      if (place.covered == 0 || !ShareLumen(add.stack, out, place)) return;
      // No heap: a wire wound tighter than that keeps the first of its contacts.
      if (out.places.size() == out.places.capacity() ||
          out.groups.size() == out.groups.capacity()) {
        return;
      }
      add.AddBeside(segment, place.past_mm, m, place.weight_mm, piece);
    });
  }
}

void CurvePairs::FindCrossing(const CombinedRods& rods, const WireState& state, LumenPairs& out) {
  const Curve& inner = state.curve(out.inner);
  const Curve& outer = state.curve(out.outer);
  PairBuilder add{rods.stack(), state.poses(), rods[out.inner], rods[out.outer],
                  inner,        outer,         with_spots_,     out};
  if (out.turned_back) {
    const int mouth = SegmentAt(add.inner_rod, inner, outer.ArcLength(add.outer_rod));
    if (outer.segments() == 0 || mouth >= inner.segments()) return;
    FacingOutside facing(inner, mouth, outer);
    for (int i = mouth; i < inner.segments(); ++i) {
      AddFacing(i, facing.Of(i), add, [](int, int) { return true; });
    }
  } else if (out.inner == out.outer) {
    FacingItself facing(inner);
    for (int i = 0; i < inner.segments(); ++i) {
      AddFacing(i, facing.Of(i), add, [](int, int) { return true; });
    }
  } else {
    InOrder in_order(PairsOf(out.inner, out.outer));
    for (int i = 0; i < inner.segments(); ++i) {
      AddFacing(i, {0, outer.segments()}, add, [&](int piece, int m) {
        return IsHeadOn(inner, i, outer, m) || !in_order.Faces(piece, m);
      });
    }
  }
}

}  // namespace torquer
