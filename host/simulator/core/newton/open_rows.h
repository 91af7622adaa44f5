// Open rows of a front: segments that it has not reached, in contact with segments behind it
// (README, section 6).
//
// A block of five rows w stands for (dx, eta) of such a segment, at the cut behind it. Where
// instruments twist, a sixth row stands for the spin of its surface. The minimum cost beyond the
// cuts is then a function of the slots z and of the rows w,
//   V(z, w) = z'P z/2 + g'z  +  w'X z  +  w'R w/2 + r'w.
// When the front reaches the segment, its slot takes the place of the block.
#pragma once

#include <Eigen/Core>
#include <bit>
#include <cstdint>
#include <vector>

#include "host/simulator/core/newton/front.h"
#include "host/simulator/core/newton/front_schedule.h"

namespace torquer {

/// Terms of a contact of curves that cross, by the rows of each side. The rows are dx and eta. If
/// the contact slides between surfaces that twist, the surface's spin follows.
struct CrossingTerms {
  static constexpr int kSteps = 5;
  static constexpr int kSpin = 5;  ///< number of the row of the spin

  const BetweenCurves::Terms& terms;
  const BetweenCurves::SpinTerms* spins = nullptr;  ///< null without

  double Gradient(int side, int row) const {
    return row == kSpin ? 0 : terms.gradient[kSteps * side + row];
  }
  double Hessian(int side, int row, int other_side, int column) const {
    if (row == kSpin && column == kSpin) return spins->hessian(side, other_side);
    if (row == kSpin) return spins->with_steps(side, kSteps * other_side + column);
    if (column == kSpin) return spins->with_steps(other_side, kSteps * side + row);
    return terms.hessian(kSteps * side + row, kSteps * other_side + column);
  }
};

/// Rows of a side of a contact in the front.
struct SideRows {
  int curve = 0;
  int at = 0;     ///< first row of the curve's slot
  int spin = -1;  ///< row of the surface's spin; -1 without

  int count() const { return spin < 0 ? CrossingTerms::kSteps : CrossingTerms::kSteps + 1; }
  int operator[](int row) const { return row == CrossingTerms::kSpin ? spin : at + row; }
};

/// Parts of the front's function that contain open rows. No heap after construction.
class OpenRows {
 public:
  static constexpr int kMostBlockRows = 6;

  /// `any`: false for curves that never cross; they need no memory. `twist`: some instruments
  /// have spins.
  OpenRows(bool any, bool twist);

  /// Rows of a block: of steps, and of a spin if instruments twist.
  int block_rows() const { return block_rows_; }
  /// Begins a block, with rows that have no effect yet.
  void Open(int block, std::uint64_t open);
  /// Adds a contact. `side` of it is the slot with the rows `own`; `block` is the other, with its
  /// spin if `with_spin`.
  template <int kRows>
  void Wait(const CrossingTerms& terms, int side, int block, bool with_spin, const SideRows& own,
            Front<kRows>& front);
  /// Puts the slot with the rows `own` in the place of a block. `open`: the blocks that stay.
  template <int kRows>
  void Close(int block, std::uint64_t open, const SideRows& own, Front<kRows>& front);

  /// Couplings of a segment's control with the open rows, before the segment is eliminated.
  struct Control {
    double f[kMostControls][kMostBlockRows * kMostOpenBlocks];
  };
  /// Finds the couplings of a segment, and moves its slot, whose first row is `at`, to the cut
  /// before it.
  void Substitute(const FrontSegment& segment, int spins, int at, std::uint64_t open);
  /// Eliminates the control. `gain`: of the slots; `inverse`: of the pivot. Writes the gains of the
  /// open rows, control by control and block by block, to `gains`.
  void Eliminate(const FrontGain& gain, const PivotInverse& inverse, int controls, int rows,
                 std::uint64_t open, double* gains);

 private:
  double* X(int row) { return &x_[static_cast<std::size_t>(row) * kMostFrontRows]; }
  // Lower triangle: column <= row.
  double& R(int row, int column) { return r_[row * (row + 1) / 2 + column]; }
  double& Coupling(int row, int column) { return row < column ? R(column, row) : R(row, column); }
  // Calls act(block) for each open block.
  template <class Act>
  static void ForEach(std::uint64_t open, Act act) {
    for (int b = 0; open >> b != 0; ++b) {
      if ((open >> b & 1) != 0) act(b);
    }
  }

  const int block_rows_;
  std::vector<double> x_;
  std::vector<double> r_;
  std::vector<double> gradient_;
  std::vector<Eigen::Vector3d> force_N_;  // by block: of its contacts, for (14)
  std::vector<Control> control_;          // one, or none
};

/// Adds one side of a contact to the slot with the rows `own`. Another call adds the other side.
/// Both sides together are at least the contact's Hessian H. Its coupling C of the sides is
/// replaced by (C C')^1/2 and (C'C)^1/2.
template <int kRows>
void AddEnd(const CrossingTerms& terms, int side, const SideRows& own, Front<kRows>& front);

using BoundMatrix = Eigen::Matrix<double, OpenRows::kMostBlockRows, OpenRows::kMostBlockRows>;
/// (C C')^1/2 of the side: the bound of its coupling.
BoundMatrix BoundOfCoupling(const CrossingTerms& terms, int side);

template <int kRows>
void AddEnd(const CrossingTerms& terms, int side, const SideRows& own, Front<kRows>& front) {
  const BoundMatrix bound = BoundOfCoupling(terms, side);
  for (int a = 0; a < own.count(); ++a) {
    front.g[own[a]] += terms.Gradient(side, a);
    for (int b = 0; b < own.count(); ++b) {
      front.p[own[a]][own[b]] += terms.Hessian(side, a, side, b) + bound(a, b);
    }
  }
  for (int d = 0; d < 3; ++d) {
    front.force_N[own.curve][d] += terms.terms.force[CrossingTerms::kSteps * side + d];
  }
}

template <int kRows>
void OpenRows::Wait(const CrossingTerms& terms, int side, int block, bool with_spin,
                    const SideRows& own, Front<kRows>& front) {
  const int other = 1 - side;
  const int first = block_rows_ * block;
  const int rows = with_spin ? CrossingTerms::kSteps + 1 : CrossingTerms::kSteps;
  for (int a = 0; a < own.count(); ++a) {
    front.g[own[a]] += terms.Gradient(side, a);
    for (int b = 0; b < own.count(); ++b) {
      front.p[own[a]][own[b]] += terms.Hessian(side, a, side, b);
    }
    for (int b = 0; b < rows; ++b) X(first + b)[own[a]] += terms.Hessian(other, b, side, a);
  }
  for (int a = 0; a < rows; ++a) {
    gradient_[first + a] += terms.Gradient(other, a);
    for (int b = 0; b <= a; ++b) R(first + a, first + b) += terms.Hessian(other, a, other, b);
  }
  for (int d = 0; d < 3; ++d) {
    front.force_N[own.curve][d] += terms.terms.force[CrossingTerms::kSteps * side + d];
    force_N_[block][d] += terms.terms.force[CrossingTerms::kSteps * other + d];
  }
}

template <int kRows>
void OpenRows::Close(int block, std::uint64_t open, const SideRows& own, Front<kRows>& front) {
  const int first = block_rows_ * block;
  for (int a = 0; a < own.count(); ++a) {
    const double* const x = X(first + a);
    for (int m = 0; m < kRows; ++m) {
      front.p[own[a]][m] += x[m];
      front.p[m][own[a]] += x[m];
    }
    for (int b = 0; b < own.count(); ++b) {
      front.p[own[a]][own[b]] += Coupling(first + a, first + b);
    }
    front.g[own[a]] += gradient_[first + a];
    ForEach(open, [&](int other) {
      for (int row = block_rows_ * other; row < block_rows_ * (other + 1); ++row) {
        X(row)[own[a]] += Coupling(row, first + a);
      }
    });
  }
  for (int d = 0; d < 3; ++d) {
    front.force_N[own.curve][d] += force_N_[block][d];
  }
}

}  // namespace torquer
