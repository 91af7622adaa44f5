// Patch force: forces distributed along the wire, and the largest force on a stretch of given
// length.
#pragma once

#include <cstddef>
#include <vector>

namespace torquer::effects {

/// Pieces of the wire, each with an amount spread evenly along it. Results do not depend on the
/// segmentation of the wire, to second order in the length of a piece.
class SpreadAlong {
 public:
  void Clear() { pieces_.clear(); }
  /// `begin_mm` and `end_mm`: distances from the tip, begin < end <= begin of the piece added
  /// before. `amount`: of the whole piece, >= 0.
  void Add(double begin_mm, double end_mm, double amount) {
    pieces_.push_back({begin_mm, end_mm, amount});
  }
  /// Stretch of the wire, and the amount on it.
  struct Stretch {
    double begin_mm = 0;  ///< from the tip
    double amount = 0;
  };
  /// Stretch of the given length, > 0, with the largest amount.
  Stretch LargestOn(double stretch_mm) const;
  /// Amount between two distances from the tip.
  double Between(double begin_mm, double end_mm) const;

 private:
  struct Piece {
    double begin_mm;
    double end_mm;
    double amount;
    /// Part of the amount that lies between two places.
    double Within(double from_mm, double to_mm) const;
  };
  std::vector<Piece> pieces_;  // in order of decreasing distance from the tip
};

}  // namespace torquer::effects
