// Pairs of curves that cross. Curves beside each other face each other head on or out of order. A
// curve may also cross itself.
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

// Calls take(m) for each segment of a curve, `from` or one beyond it, that faces a point within
// reach.
template <class Take>
void ForEachFacing(const WireModel& rod, const Curve& curve, const Vector3d& point, int from,
                   Take take) {
  const double longest_mm = 1.5 * rod.segment_mm();
  for (int m = from; m < curve.segments(); ++m) {
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

// Segments of a curve that can face its own earlier places. A curve that has turned by less than a
// right angle since a place, all turns added, faces it nowhere.
class TurnedBack {
 public:
  explicit TurnedBack(const Curve& curve) : tangents_(curve.tangents()) {}

  // First segment that can face a place of a segment. Segments must ascend one by one.
  int From(int segment) {
    if (segment > 0 && first_ >= segment) turned_rad_ -= MostTurnRad(segment - 1);
    first_ = std::max(first_, segment);
    const int last = static_cast<int>(tangents_.size()) - 1;
    while (first_ < last && turned_rad_ + MostTurnRad(first_) < kLeastRad) {
      turned_rad_ += MostTurnRad(first_++);
    }
    return std::max(first_ + 1, segment + kApart);
  }

 private:
  static constexpr double kLeastRad = 1.5;

  // Bound of the angle between a tangent and the next one: an arc is at most pi/2 chords.
  double MostTurnRad(int segment) const {
    return M_PI / 2 * (tangents_[segment + 1] - tangents_[segment]).norm();
  }

  const std::vector<Vector3d>& tangents_;
  int first_ = 0;          // last segment that cannot face the place
  double turned_rad_ = 0;  // from the place's segment to it
};

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

void CurvePairs::FindCrossing(const CombinedRods& rods, const WireState& state, LumenPairs& out) {
  const Curve& inner = state.curve(out.inner);
  const Curve& outer = state.curve(out.outer);
  PairBuilder add{rods.stack(), state.poses(), rods[out.inner], rods[out.outer],
                  inner,        outer,         with_spots_,     out};
  const bool itself = out.inner == out.outer;
  InOrder in_order(PairsOf(out.inner, out.outer));
  TurnedBack turned_back(inner);
  for (int i = 0; i < inner.segments(); ++i) {
    const int from = itself ? turned_back.From(i) : 0;
    if (from >= outer.segments()) break;
    for (int k = 0; k < out.pieces_per_segment; ++k) {
      ForEachFacing(add.outer_rod, outer, add.MiddleOf(i, k), from, [&](int m) {
        if (!itself && !IsHeadOn(inner, i, outer, m) &&
            in_order.Faces(i * out.pieces_per_segment + k, m)) {
          return;
        }
        const BesidePlace place = add.FindBeside(i, k, m);
        if (place.covered == 0 || !ShareLumen(rods.stack(), out, place)) return;
        // No heap: a wire wound tighter than that keeps the first of its contacts.
        if (out.places.size() == out.places.capacity() ||
            out.groups.size() == out.groups.capacity()) {
          return;
        }
        add.AddBeside(i, place.past_mm, m, place.weight_mm, i * out.pieces_per_segment + k);
      });
    }
  }
}

}  // namespace torquer
