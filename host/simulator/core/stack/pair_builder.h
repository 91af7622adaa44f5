// Pair builder: adds places to the pairs of two curves.
#pragma once

#include <Eigen/Core>

#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/stack/lumen_pairs.h"

namespace torquer {

/// Largest distance of the axes, mm, at which a place of curves beside each other is paired. One
/// part of the motion covers less.
inline constexpr double kReachMm = 5;

/// Arc length of the proximal node of a segment, mm.
double ArcMm(const WireModel& rod, const Curve& curve, int segment);

/// True if two segments face each other at more than some 96 degrees. The feet of the inner curve
/// then run towards the sheath, so the curves cannot be in order.
bool IsHeadOn(const Curve& inner, int segment, const Curve& outer, int outer_segment);

/// Place on a piece of the inner curve, beside the outer curve.
struct BesidePlace {
  double past_mm = 0;      ///< past the proximal node of the inner segment
  double arc_mm = 0;       ///< arc length of the inner curve
  double foot_arc_mm = 0;  ///< arc length of the outer curve, of the foot
  double covered = 0;      ///< part of the piece that the outer curve covers; 0 if none faces it
  double weight_mm = 0;    ///< length of the inner curve that is covered
};

/// Both curves of a pair, and their pairs, which grow.
struct PairBuilder {
  const InstrumentStack& stack;
  const InstrumentPoses& poses;
  const WireModel& inner_rod;
  const WireModel& outer_rod;
  const Curve& inner;
  const Curve& outer;
  const bool with_spots;
  LumenPairs& out;
  /// Curvature of the segment that was asked for last, on each curve.
  struct Last {
    int segment = -1;
    Eigen::Vector2d curvature = Eigen::Vector2d::Zero();
  };
  Last last_inner = {};
  Last last_outer = {};

  /// Adds the places of the piece from `from_mm` to `to_mm` of a segment in a lumen.
  void AddPiece(int segment, double from_mm, double to_mm, int outer_segment);
  /// Adds the tip of the inner curve. An edge acts along a length of about its own width.
  void AddTip(int outer_segment);
  /// Adds the mouth, where the inner curve passes it.
  void AddMouth(int segment, double past_mm);
  /// Middle of piece `k` of a segment of the inner curve.
  Eigen::Vector3d MiddleOf(int segment, int k) const;
  /// Finds the place of contact of that piece with the line of an outer segment.
  BesidePlace FindBeside(int segment, int k, int outer_segment) const;
  /// Adds a place of curves beside each other, on piece `piece` of the inner curve, counted from
  /// the sheath. The place represents `weight_mm` of this piece.
  void AddBeside(int segment, double past_mm, int outer_segment, double weight_mm, int piece);
  /// Adds a spot at the last place, unless curves that cross are far from contact there.
  void AddSpotBeside();
  /// The same place on the lines of the segments `on`, which may end before it.
  LumenPlace Moved(const LumenPlace& place, const SegmentPair& on);

 private:
  const Eigen::Vector2d& InnerCurvature(int segment);
  const Eigen::Vector2d& OuterCurvature(int segment);
  int PieceOf(int segment, double past_mm) const;
  int GroupOf(int segment, int outer_segment);
  // A place without its group.
  LumenPlace Make(int segment, double past_mm, int outer_segment, double weight_mm);
  LumenPlace PlaceAt(int segment, double past_mm, int outer_segment, double weight_mm);
  Eigen::Vector2d LumenBulge(const LumenPlace& place) const;
};

}  // namespace torquer
