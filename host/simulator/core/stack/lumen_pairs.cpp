#include "host/simulator/core/stack/lumen_pairs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "host/simulator/core/hash.h"

namespace torquer {

using Eigen::Vector3d;

namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kShortestMm = 1e-9;  // shorter pieces have no place

double ArcMm(const WireModel& rod, const Curve& curve, int segment) {
  return segment == 0 ? 0 : curve.first_segment_mm() + (segment - 1) * rod.segment_mm();
}

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
      ends_(static_cast<std::size_t>(stack.curves())) {
  const auto segments = static_cast<std::size_t>(stack.rod().max_segments()) + 1;
  const auto pieces =
      segments * static_cast<std::size_t>(LumenPairs::PiecesPerSegment(points_per_segment));
  for (int inner = 0; inner < stack.curves(); ++inner) {
    for (int outer = inner + 1; outer < stack.curves(); ++outer) {
      LumenPairs& pairs = pairs_.emplace_back();
      pairs.inner = inner;
      pairs.outer = outer;
      pairs.pieces_per_segment = LumenPairs::PiecesPerSegment(points_per_segment);
      pairs.groups.reserve(2 * segments);
      pairs.places.reserve(2 * segments + pieces);
      pairs.spots.reserve(pieces);
    }
  }
}

namespace {

// Way along a line, past `from_mm`, at which it crosses the plane through `at` across `normal`.
double CrossingMm(const Vector3d& begin, const Vector3d& direction, double from_mm,
                  const Vector3d& at, const Vector3d& normal) {
  constexpr double kLeastSlope = 1e-6;
  const double slope = direction.dot(normal);
  if (!(slope > kLeastSlope)) return kInfinite;
  return std::max(from_mm, (at - begin).dot(normal) / slope);
}

// Curvature of the smooth curve through the nodes, at a segment, in its normals, 1/mm.
Eigen::Vector2d CurvatureAt(const WireModel& rod, const Curve& curve, int segment) {
  constexpr double kMostBendRad = 0.5;  // of a segment: a chord of a sharper bend is no chord
  const auto i = static_cast<std::size_t>(segment);
  const Vector3d& tangent = curve.tangents()[i];
  const Vector3d& before = i == 0 ? rod.sheath().direction : curve.tangents()[i - 1];
  Vector3d curvature = (tangent - before) / JointLength(rod, curve, segment);
  if (segment + 1 < curve.segments()) {
    const Vector3d beyond =
        (curve.tangents()[i + 1] - tangent) / JointLength(rod, curve, segment + 1);
    curvature = (curvature + beyond) / 2;
  }
  const Vector3d& normal = curve.normals()[i];
  Eigen::Vector2d across(curvature.dot(normal), curvature.dot(tangent.cross(normal)));
  const double bend_rad = across.norm() * curve.SegmentLength(rod, segment);
  return bend_rad > kMostBendRad ? Eigen::Vector2d(kMostBendRad / bend_rad * across) : across;
}

// Both curves of a pair, for the places that are added to it.
struct PairBuilder {
  const InstrumentStack& stack;
  const InstrumentPlaces& instruments;
  const WireModel& inner_rod;
  const WireModel& outer_rod;
  const Curve& inner;
  const Curve& outer;
  const bool with_spots;
  LumenPairs& out;
  // Curvature of the segment that was asked for last, on each curve.
  struct Last {
    int segment = -1;
    Eigen::Vector2d curvature = Eigen::Vector2d::Zero();
  };
  Last last_inner = {};
  Last last_outer = {};

  const Eigen::Vector2d& InnerCurvature(int segment) {
    if (last_inner.segment != segment) {
      last_inner = {segment, CurvatureAt(inner_rod, inner, segment)};
    }
    return last_inner.curvature;
  }
  const Eigen::Vector2d& OuterCurvature(int segment) {
    if (last_outer.segment != segment) {
      last_outer = {segment, CurvatureAt(outer_rod, outer, segment)};
    }
    return last_outer.curvature;
  }

  LumenPlace PlaceAt(int segment, double past_mm, int outer_segment, double weight_mm) {
    if (out.groups.empty() || out.groups.back().inner != segment ||
        out.groups.back().outer != outer_segment) {
      out.groups.push_back({segment, outer_segment});
    }
    const Vector3d at = inner.nodes()[static_cast<std::size_t>(segment)] +
                        past_mm * inner.tangents()[static_cast<std::size_t>(segment)];
    const auto m = static_cast<std::size_t>(outer_segment);
    const double foot_mm = outer.tangents()[m].dot(at - outer.nodes()[m]);
    const double arc_mm = ArcMm(inner_rod, inner, segment) + past_mm;
    const double outer_begin_mm = ArcMm(outer_rod, outer, outer_segment);
    LumenPlace place;
    place.segment = segment;
    place.outer_segment = outer_segment;
    place.group = static_cast<int>(out.groups.size()) - 1;
    place.inner = stack.SurfaceAt(out.inner, instruments, arc_mm);
    place.outer = stack.LumenAt(out.outer, instruments, outer_begin_mm + foot_mm);
    place.past_mm = past_mm;
    place.foot_mm = foot_mm;
    place.weight_mm = weight_mm;
    place.radius_mm = inner_rod.radius_mm(inner.segments() - 1 - segment);
    place.lumen_mm = stack.clearance().lumen_radius_mm[static_cast<std::size_t>(place.outer)];
    place.ahead_mm = instruments[place.inner].insertion_mm - arc_mm -
                     (instruments[place.outer].insertion_mm - outer_begin_mm);
    // A circle through the ends of a chord is beside it by kappa t (l - t) / 2.
    const double length_mm = inner.SegmentLength(inner_rod, segment);
    const double outer_mm = outer.SegmentLength(outer_rod, outer_segment);
    const Eigen::Vector2d& bend = OuterCurvature(outer_segment);
    const double foot_on_mm = std::clamp(foot_mm, 0.0, outer_mm);
    place.bulge_mm = -past_mm * (length_mm - past_mm) / 2 * InnerCurvature(segment);
    place.foot_bulge_mm = -foot_on_mm * (outer_mm - foot_on_mm) / 2 * bend;
    place.foot_slope = (foot_on_mm - outer_mm / 2) * bend;
    return place;
  }

  Eigen::Vector2d LumenBulge(const LumenPlace& place) const {
    const auto i = static_cast<std::size_t>(place.segment);
    const auto m = static_cast<std::size_t>(place.outer_segment);
    const Vector3d& normal = inner.normals()[i];
    const Vector3d& along = outer.tangents()[m];
    const double turn_rad =
        outer.turns_rad().empty() ? 0 : outer.turns_rad()[m][static_cast<std::size_t>(place.outer)];
    const Vector3d first = TurnedAbout(along, outer.normals()[m], turn_rad);
    const Vector3d bulge_mm = place.bulge_mm[0] * normal +
                              place.bulge_mm[1] * inner.tangents()[i].cross(normal) -
                              place.foot_bulge_mm[0] * outer.normals()[m] -
                              place.foot_bulge_mm[1] * along.cross(outer.normals()[m]);
    return {bulge_mm.dot(first), bulge_mm.dot(along.cross(first))};
  }

  // Adds the places of the piece from `from_mm` to `to_mm` of a segment.
  void AddPiece(int segment, double from_mm, double to_mm, int outer_segment) {
    const double length_mm = to_mm - from_mm;
    if (length_mm > kShortestMm) {
      constexpr double kRounding = 1e-9;
      const double parts = length_mm * out.pieces_per_segment / inner_rod.segment_mm();
      const int count = std::max(1, static_cast<int>(std::ceil(parts - kRounding)));
      for (int k = 0; k < count; ++k) {
        out.places.push_back(PlaceAt(segment, from_mm + (k + 0.5) * length_mm / count,
                                     outer_segment, length_mm / count));
      }
    }
    if (!with_spots) return;
    const double piece_mm = inner.SegmentLength(inner_rod, segment) / out.pieces_per_segment;
    for (int k = 0; k < out.pieces_per_segment; ++k) {
      const double past_mm = (k + 0.5) * piece_mm;
      if (past_mm < from_mm || past_mm >= to_mm) continue;
      if (out.spots.empty()) out.first_spot = segment * out.pieces_per_segment + k;
      LumenPlace& spot = out.spots.emplace_back(PlaceAt(segment, past_mm, outer_segment, piece_mm));
      spot.lumen_bulge_mm = LumenBulge(spot);
    }
  }

  // The tip of the inner curve. An edge acts along a length of about its own width.
  void AddTip(int outer_segment) {
    const int segment = inner.segments() - 1;
    LumenPlace place = PlaceAt(segment, inner.SegmentLength(inner_rod, segment), outer_segment, 0);
    place.weight_mm = place.lumen_mm;
    out.places.push_back(place);
  }

  // The mouth, where the inner curve passes it.
  void AddMouth(int segment, double past_mm) {
    LumenPlace place = PlaceAt(segment, past_mm, outer.segments() - 1, 0);
    place.weight_mm = place.lumen_mm;
    place.is_mouth = true;
    place.foot_bulge_mm = place.bulge_mm;
    place.bulge_mm.setZero();
    place.foot_slope =
        (past_mm - inner.SegmentLength(inner_rod, segment) / 2) * InnerCurvature(segment);
    out.places.push_back(place);
  }
};

}  // namespace

// Adds the places of a pair, from `walk` to the mouth or the tip. Returns true at the tip.
bool CurvePairs::WalkLumen(const InstrumentStack& stack, const WireState& state, Walk& walk,
                           LumenPairs& out) const {
  const Curve& inner = state.curve(out.inner);
  const Curve& outer = state.curve(out.outer);
  PairBuilder add{stack, state.places(), stack.rod(out.inner), stack.rod(out.outer),
                  inner, outer,          with_spots_,          out};
  int& m = walk.outer_segment;
  bool begun = false;
  out.at_mouth = false;
  while (walk.segment < inner.segments()) {
    const auto i = static_cast<std::size_t>(walk.segment);
    const double length_mm = inner.SegmentLength(add.inner_rod, walk.segment);
    const bool last = m + 1 == outer.segments();
    const Vector3d& before = outer.tangents()[static_cast<std::size_t>(m)];
    const Vector3d plane =
        last ? before : before + outer.tangents()[static_cast<std::size_t>(m) + 1];
    const double end_mm = CrossingMm(inner.nodes()[i], inner.tangents()[i], walk.past_mm,
                                     outer.nodes()[static_cast<std::size_t>(m) + 1], plane);
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

void CurvePairs::Find(const InstrumentStack& stack, const WireState& state, bool with_spots) {
  with_spots_ = with_spots;
  for (LumenPairs& pairs : pairs_) {
    pairs.groups.clear();
    pairs.places.clear();
    pairs.spots.clear();
  }
  // From the outermost inwards: an instrument that leaves a curve through its mouth is where that
  // curve's tip is.
  for (int inner = curves_ - 1; inner >= 0; --inner) {
    End& end = ends_[static_cast<std::size_t>(inner)];
    end = {curves_, 0};
    const Curve& curve = state.curve(inner);
    Walk walk;
    int outer = inner + 1;
    while (outer < curves_ && state.curve(outer).segments() == 0) ++outer;
    bool at_tip = false;
    while (outer < curves_ && curve.segments() > 0) {
      at_tip = WalkLumen(stack, state, walk, PairsOf(inner, outer));
      if (at_tip) {
        end = {outer, walk.outer_segment};
        break;
      }
      const End& mouth = ends_[static_cast<std::size_t>(outer)];
      outer = mouth.in_curve;
      walk.outer_segment = mouth.segment;
    }
    in_lumen_mm_[static_cast<std::size_t>(inner)] =
        at_tip ? kInfinite : ArcMm(stack.rod(inner), curve, walk.segment) + walk.past_mm;
  }
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
