// Pair builder: adds places to the pairs of two curves.
#pragma once

#include <Eigen/Core>

#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/stack/lumen_pairs.h"

namespace torquer {

/// Arc length of the proximal node of a segment, mm.
double ArcMm(const WireModel& rod, const Curve& curve, int segment);

/// Both curves of a pair, and the pairs to which places are added.
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
  /// Adds a place of curves beside each other: on piece `piece` of the inner curve, counted from
  /// the sheath, of which it stands for `weight_mm`.
  void AddBeside(int segment, double past_mm, int outer_segment, double weight_mm, int piece);
  /// The same place on the lines of the segments `on`, which may end before it.
  LumenPlace Moved(const LumenPlace& place, const SegmentPair& on);

 private:
  const Eigen::Vector2d& InnerCurvature(int segment);
  const Eigen::Vector2d& OuterCurvature(int segment);
  int PieceOf(int segment, double past_mm) const;
  // A place without its group.
  LumenPlace Make(int segment, double past_mm, int outer_segment, double weight_mm);
  LumenPlace PlaceAt(int segment, double past_mm, int outer_segment, double weight_mm);
  Eigen::Vector2d LumenBulge(const LumenPlace& place) const;
};

}  // namespace torquer
