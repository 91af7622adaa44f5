// Lumen pairs: the places of a curve in the lumen of a curve around it (README, section 18). Each
// place has the segment of the outer curve that faces it.
//
// A place faces the segment that has its foot, the nearest point of the outer curve. Segments meet
// at the plane that bisects their angle. These planes divide the inner curve into pieces. So each
// place stands for a piece that faces one segment. Distances are those of the smooth curves through
// the nodes. Chords alone would hold a wire that slides from node to node.
//
//   outer   |-------- m --------|------ m + 1 ------|
//   inner      |------- i --------|------ i + 1 ------|      pieces (i, m) (i, m+1) (i+1, m+1)
//
// Curves beside each other are paired in the same way (beside_pairs.cpp). The surface of the outer
// curve, seen from outside, replaces the lumen's wall. The outer curve has the higher number.
//
// Separate pairs have the places that face each other head on or out of order (crossing_pairs.cpp).
// So do the places of a curve that comes near itself. Others have left the lumen of a curve and
// come near its outside. They have no order from sheath to tip.
//
// The pairs are those of a state when a part of the motion begins, and stay while it is relaxed. So
// the energy of that part is smooth.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "host/simulator/core/stack/combined_rods.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Place on a segment of the inner curve, and the segment that it faces. At the mouth, a point at
/// the end of the outer curve faces the inner curve instead.
struct LumenPlace {
  bool is_mouth = false;
  int segment = 0;        ///< of the inner curve
  int outer_segment = 0;  ///< of the outer curve
  int group = 0;          ///< index of both in LumenPairs::groups
  int inner = 0;          ///< instrument whose surface faces the lumen
  int outer = 0;          ///< instrument of the lumen
  double past_mm = 0;     ///< past the proximal node of the inner segment
  double foot_mm = 0;     ///< of its foot, past the proximal node of the outer segment
  double weight_mm = 0;   ///< length of the inner curve that the place stands for
  /// Distance from the axis of the inner curve to its contact point, along the normal away from the
  /// outer axis. In a lumen it is the radius, beside the outer curve minus the radius.
  double lever_mm = 0;
  double lumen_mm = 0;  ///< radius of the lumen, or of the outer curve beside the inner one
  int piece = 0;        ///< number of its piece of the inner curve, from the sheath
  /// LumenContact::ahead_mm, less the way of the foot past the proximal node of the outer segment.
  double ahead_mm = 0;
  /// Segments are chords of smooth curves. Offsets of both curves from their chords at the place
  /// and its foot, in each segment's normals, mm. Then the tangent of the faced curve there, minus
  /// the tangent of its chord.
  Eigen::Vector2d bulge_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d foot_bulge_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d foot_slope = Eigen::Vector2d::Zero();
  /// Difference of the bulges in the first and second normal of the lumen, mm.
  Eigen::Vector2d lumen_bulge_mm = Eigen::Vector2d::Zero();

  /// Takes the chords as the curves.
  void ForgetBulges() {
    bulge_mm.setZero();
    foot_bulge_mm.setZero();
    foot_slope.setZero();
  }
};

struct BesidePlace;
struct PairBuilder;

/// Pair of segments, one of each curve.
struct SegmentPair {
  int inner = 0;
  int outer = 0;
};

/// Segments of a curve, from `begin` to before `end`.
struct SegmentStretch {
  int begin = 0;
  int end = 0;
};

/// Places of two curves.
struct LumenPairs {
  int number = 0;  ///< index in CurvePairs::of_curves
  int inner = 0;   ///< number of the inner curve
  /// Number of the outer curve: above that of the inner one, or the same if the curve touches
  /// itself.
  int outer = 0;
  bool beside = false;  ///< the curves lie beside each other, not within
  /// The inner curve has left the lumen of the outer one, turns back, and comes beside it.
  bool turned_back = false;
  /// Neither index of the groups decreases. False for curves that cross.
  bool ordered = true;
  std::vector<SegmentPair> groups;  ///< from the sheath
  /// Contact places, from the sheath. In a lumen each stands in the middle of its piece. The last
  /// is the edge of the outer curve's mouth, or of the inner curve's tip.
  std::vector<LumenPlace> places;
  /// Places of friction, ascending by piece: at most one for each of the `PiecesPerSegment` pieces
  /// of an inner segment. In a lumen none is left out, up to the last. Curves that cross have one
  /// at each place that is within a piece of contact.
  std::vector<LumenPlace> spots;
  bool at_mouth = false;  ///< the last place is the mouth
  int pieces_per_segment = 2;

  /// Pieces of a segment. With one place alone, nodes would go to and fro.
  static int PiecesPerSegment(int points_per_segment) { return std::max(2, points_per_segment); }
  /// Most spots of curves that cross, of which the inner one has `pieces`.
  static std::size_t MostCrossingSpots(std::size_t pieces) { return 2 * pieces; }
};

/// Pairs of all curves of a state. No heap after construction.
class CurvePairs {
 public:
  /// Room for the longest curves of `stack`, with `points_per_segment` points each.
  CurvePairs(const InstrumentStack& stack, int points_per_segment);

  /// Finds the pairs of a state. `with_spots`: something slides in the lumens. O(segments).
  void Find(const CombinedRods& rods, const WireState& state, bool with_spots);

  const std::vector<LumenPairs>& of_curves() const { return pairs_; }
  /// Arc length, mm, up to which a curve lies in the lumen of another one. Infinite if all of it
  /// does, 0 for the outermost.
  double in_lumen_mm(int curve) const { return in_lumen_mm_[curve]; }
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  struct Walk;
  // Arc length, mm, at which a curve leaves the lumen of a curve around it.
  double& LeavesMm(int curve, int lumen) { return leaves_mm_[curve * curves_ + lumen]; }
  int LumenOf(const InstrumentStack& stack, int curve, double arc_mm) const;
  bool ShareLumen(const InstrumentStack& stack, const LumenPairs& pairs,
                  const BesidePlace& place) const;
  void FindInLumens(const CombinedRods& rods, const WireState& state, int inner);
  LumenPairs& AddPairs(int inner, int outer);
  void FindBeside(const CombinedRods& rods, const WireState& state, LumenPairs& out) const;
  void FindCrossing(const CombinedRods& rods, const WireState& state, LumenPairs& out);
  template <class Takes>
  void AddFacing(int segment, const SegmentStretch& stretch, PairBuilder& add, Takes takes) const;
  void OrderBeside(const CombinedRods& rods, const WireState& state);
  void MoveGroup(const CombinedRods& rods, const WireState& state, const SegmentPair& on, int group,
                 LumenPairs& pairs) const;
  bool WalkLumen(const CombinedRods& rods, const WireState& state, Walk& walk,
                 LumenPairs& out) const;

  LumenPairs& PairsOf(int inner, int outer);

  // The tip of a curve: the curve around it, or curves_ outside all, and the segment there.
  struct End {
    int in_curve = 0;
    int segment = 0;
  };

  int curves_;
  bool with_spots_ = true;
  std::vector<LumenPairs> pairs_;
  std::vector<double> in_lumen_mm_;  // by curve
  std::vector<End> ends_;            // by curve
  std::vector<double> leaves_mm_;    // by curve and lumen
  std::vector<int> left_;            // by pair: groups that OrderBeside has not reached
};

}  // namespace torquer
