#include "host/simulator/core/stack/lumen_pairs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "host/simulator/core/hash.h"
#include "host/simulator/core/stack/pair_builder.h"

namespace torquer {

using Eigen::Vector3d;

namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

}  // namespace

// Position on an inner curve on the way from the sheath, and the segment of the outer one there.
struct CurvePairs::Walk {
  int segment = 0;
  double past_mm = 0;
  int outer_segment = 0;
};

CurvePairs::CurvePairs(const InstrumentStack& stack, int points_per_segment)
    : curves_(stack.curves()),
      in_lumen_mm_(static_cast<std::size_t>(stack.curves())),
      ends_(static_cast<std::size_t>(stack.curves())),
      leaves_mm_(in_lumen_mm_.size() * in_lumen_mm_.size()) {
  const auto segments = static_cast<std::size_t>(stack.empty_rod().max_segments()) + 1;
  const auto pieces =
      segments * static_cast<std::size_t>(LumenPairs::PiecesPerSegment(points_per_segment));
  const bool touches_itself = stack.clearance().touches_itself;
  const auto cross = [&](int inner, int outer) {
    // A wire that fills a cavity faces some six neighbors.
    constexpr std::size_t kMostFaced = 6;
    LumenPairs& pairs = AddPairs(inner, outer);
    pairs.beside = true;
    pairs.ordered = false;
    pairs.turned_back = inner != outer && !stack.AreBeside(inner, outer);
    pairs.groups.reserve(kMostFaced * segments);
    pairs.places.reserve(kMostFaced * pieces);
    pairs.spots.reserve(LumenPairs::MostCrossingSpots(pieces));
  };
  for (int inner = 0; inner < stack.curves(); ++inner) {
    for (int outer = inner + 1; outer < stack.curves(); ++outer) {
      const bool beside = stack.AreBeside(inner, outer);
      LumenPairs& pairs = AddPairs(inner, outer);
      pairs.beside = beside;
      pairs.groups.reserve(2 * segments);
      pairs.places.reserve(2 * segments + pieces);
      pairs.spots.reserve(pieces);
      if (beside || touches_itself) cross(inner, outer);
    }
    if (touches_itself) cross(inner, inner);
  }
  for (LumenPairs& pairs : pairs_) {
    pairs.pieces_per_segment = LumenPairs::PiecesPerSegment(points_per_segment);
  }
  left_.resize(pairs_.size());
}

LumenPairs& CurvePairs::AddPairs(int inner, int outer) {
  const auto number = static_cast<int>(pairs_.size());
  LumenPairs& pairs = pairs_.emplace_back();
  pairs.number = number;
  pairs.inner = inner;
  pairs.outer = outer;
  return pairs;
}

namespace {

// Distance along a line, past `from_mm`, to the plane through `at` across `normal`.
double CrossingMm(const Vector3d& begin, const Vector3d& direction, double from_mm,
                  const Vector3d& at, const Vector3d& normal) {
  constexpr double kLeastSlope = 1e-6;
  const double slope = direction.dot(normal);
  if (!(slope > kLeastSlope)) return kInfinite;
  return std::max(from_mm, (at - begin).dot(normal) / slope);
}

}  // namespace

// Adds the places of a pair, from `walk` to the mouth or the tip. Returns true at the tip.
bool CurvePairs::WalkLumen(const CombinedRods& rods, const WireState& state, Walk& walk,
                           LumenPairs& out) const {
  const Curve& inner = state.curve(out.inner);
  const Curve& outer = state.curve(out.outer);
  PairBuilder add{rods.stack(), state.poses(), rods[out.inner], rods[out.outer],
                  inner,        outer,         with_spots_,     out};
  int& m = walk.outer_segment;
  bool begun = false;
  out.at_mouth = false;
  while (walk.segment < inner.segments()) {
    const int i = walk.segment;
    const double length_mm = inner.SegmentLength(add.inner_rod, walk.segment);
    const bool last = m + 1 == outer.segments();
    const Vector3d& before = outer.tangents()[m];
    const Vector3d plane = last ? before : before + outer.tangents()[m + 1];
    const double end_mm = CrossingMm(inner.nodes()[i], inner.tangents()[i], walk.past_mm,
                                     outer.nodes()[m + 1], plane);
    if (end_mm > walk.past_mm) {
      add.AddPiece(walk.segment, walk.past_mm, std::min(end_mm, length_mm), m);
      begun = true;
    }
    if (end_mm < length_mm) {
      walk.past_mm = end_mm;
      if (!last) {
        ++m;
        continue;
      }
      out.at_mouth = true;
      if (begun) add.AddMouth(walk.segment, walk.past_mm);
      return false;
    }
    ++walk.segment;
    walk.past_mm = 0;
  }
  if (begun) add.AddTip(m);
  return true;
}

void CurvePairs::Find(const CombinedRods& rods, const WireState& state, bool with_spots) {
  with_spots_ = with_spots;
  for (LumenPairs& pairs : pairs_) {
    pairs.groups.clear();
    pairs.places.clear();
    pairs.spots.clear();
  }
  std::fill(leaves_mm_.begin(), leaves_mm_.end(), 0);
  // From the outermost inwards: an instrument that leaves a curve through its mouth is where that
  // curve's tip is.
  for (int inner = curves_ - 1; inner >= 0; --inner) FindInLumens(rods, state, inner);
  for (LumenPairs& pairs : pairs_) {
    if (!pairs.ordered) {
      FindCrossing(rods, state, pairs);
    } else if (pairs.beside) {
      FindBeside(rods, state, pairs);
    }
  }
  OrderBeside(rods, state);
}

void CurvePairs::FindInLumens(const CombinedRods& rods, const WireState& state, int inner) {
  End& end = ends_[inner];
  end = {curves_, 0};
  const Curve& curve = state.curve(inner);
  Walk walk;
  const InstrumentStack& stack = rods.stack();
  int outer = stack.CurveAround(inner);
  while (outer < curves_ && state.curve(outer).segments() == 0) outer = stack.CurveAround(outer);
  bool at_tip = false;
  while (outer < curves_ && curve.segments() > 0) {
    at_tip = WalkLumen(rods, state, walk, PairsOf(inner, outer));
    LeavesMm(inner, outer) =
        at_tip ? kInfinite : ArcMm(rods[inner], curve, walk.segment) + walk.past_mm;
    if (at_tip) {
      end = {outer, walk.outer_segment};
      break;
    }
    const End& mouth = ends_[outer];
    outer = mouth.in_curve;
    walk.outer_segment = mouth.segment;
  }
  in_lumen_mm_[inner] = at_tip ? kInfinite : ArcMm(rods[inner], curve, walk.segment) + walk.past_mm;
}

// Curve in whose lumen a curve lies at an arc length; curves_ if it lies in the vessel.
int CurvePairs::LumenOf(const InstrumentStack& stack, int curve, double arc_mm) const {
  int lumen = stack.CurveAround(curve);
  while (lumen < curves_ && arc_mm >= leaves_mm_[curve * curves_ + lumen]) {
    lumen = stack.CurveAround(lumen);
  }
  return lumen;
}

LumenPairs& CurvePairs::PairsOf(int inner, int outer) {
  return *std::find_if(pairs_.begin(), pairs_.end(), [&](const LumenPairs& pairs) {
    return pairs.inner == inner && pairs.outer == outer;
  });
}

std::uint64_t CurvePairs::Hash(std::uint64_t seed) const {
  for (const LumenPairs& pairs : pairs_) {
    for (const std::vector<LumenPlace>* const places : {&pairs.places, &pairs.spots}) {
      for (const LumenPlace& place : *places) {
        const auto segment = static_cast<std::uint64_t>(place.outer_segment);
        seed = HashDouble(place.past_mm, HashWord(segment, seed));
        for (const Eigen::Vector2d* const bulge : {&place.bulge_mm, &place.foot_bulge_mm}) {
          seed = HashDouble((*bulge)[1], HashDouble((*bulge)[0], seed));
        }
      }
    }
  }
  return seed;
}

}  // namespace torquer
