#include "host/simulator/effects/observers/patch_force.h"

#include <algorithm>

namespace torquer::effects {

double SpreadAlong::Piece::Within(double from_mm, double to_mm) const {
  const double overlap_mm = std::min(end_mm, to_mm) - std::max(begin_mm, from_mm);
  return overlap_mm <= 0 ? 0 : amount * std::min(1.0, overlap_mm / (end_mm - begin_mm));
}

double SpreadAlong::Between(double begin_mm, double end_mm) const {
  double sum = 0;
  for (const Piece& piece : pieces_) sum += piece.Within(begin_mm, end_mm);
  return sum;
}

// The density is constant along a piece. So a stretch with the largest amount begins or ends at an
// end of a piece.
SpreadAlong::Stretch SpreadAlong::LargestOn(double stretch_mm) const {
  Stretch largest;
  std::size_t first = 0;  // first piece that overlaps the current stretches
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    // Candidates: a stretch that ends at the proximal end of piece i, or begins at its distal end.
    const double ends_mm = pieces_[i].end_mm;
    double sum = 0;
    for (std::size_t k = i; k < pieces_.size(); ++k) {
      if (pieces_[k].end_mm <= ends_mm - stretch_mm) break;
      sum += pieces_[k].Within(ends_mm - stretch_mm, ends_mm);
    }
    if (sum > largest.amount) largest = {ends_mm - stretch_mm, sum};
    const double begins_mm = pieces_[i].begin_mm;
    while (pieces_[first].begin_mm >= begins_mm + stretch_mm) ++first;
    sum = 0;
    for (std::size_t k = first; k <= i; ++k) {
      sum += pieces_[k].Within(begins_mm, begins_mm + stretch_mm);
    }
    if (sum > largest.amount) largest = {begins_mm, sum};
  }
  return largest;
}

}  // namespace torquer::effects
