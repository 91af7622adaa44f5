// Forces spread along the wire, and the most of them on a stretch of given length.
#pragma once

#include <cstddef>
#include <vector>

namespace torquer::effects {

/// Pieces of the wire, each with something spread evenly along it. What it finds does not depend on
/// how finely the wire is cut, to second order in the length of a piece.
class SpreadAlong {
 public:
  void Clear() { pieces_.clear(); }
  /// `begin_mm` and `end_mm`: distances from the tip, begin < end, at most the begin of the piece
  /// that was added before; `amount`: of the whole piece, >= 0.
  void Add(double begin_mm, double end_mm, double amount) {
    pieces_.push_back({begin_mm, end_mm, amount});
  }
  /// A stretch of the wire, and what is on it.
  struct Stretch {
    double begin_mm = 0;  ///< from the tip
    double amount = 0;
  };
  /// The stretch of this length, > 0, with the largest amount.
  Stretch LargestOn(double stretch_mm) const;
  /// The amount between two distances from the tip.
  double Between(double begin_mm, double end_mm) const;

 private:
  struct Piece {
    double begin_mm;
    double end_mm;
    double amount;
    /// What of it lies between two places.
    double Within(double from_mm, double to_mm) const;
  };
  std::vector<Piece> pieces_;  // the farthest from the tip first
};

}  // namespace torquer::effects
