// Open rows of a front: segments that it has not reached yet, in contact with segments that it has
// passed (README, section 6).
//
// A block of five rows w stands for (dx, eta) of such a segment, at the cut behind it. The minimum
// cost beyond the cuts is then a function of the slots z and of the rows w,
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

/// Parts of the front's function that contain open rows. No heap after construction.
class OpenRows {
 public:
  static constexpr int kBlockRows = 5;

  /// `any`: false for curves that never cross, which need no memory.
  explicit OpenRows(bool any);

  /// Begins a block, with rows that have no effect yet.
  void Open(int block, std::uint64_t open);
  /// Adds a contact. `side` of the contact is the slot at row `at`, of curve `curve`; `block` is
  /// the other side.
  template <int kRows>
  void Wait(const BetweenCurves::Terms& terms, int side, int block, int curve, int at,
            Front<kRows>& front);
  /// Puts the slot of `curve`, at row `at`, in the place of a block. `open`: the blocks that stay.
  template <int kRows>
  void Close(int block, std::uint64_t open, int curve, int at, Front<kRows>& front);

  /// Couplings of a segment's control with the open rows, before the segment is eliminated.
  struct Control {
    double f[kMostControls][kBlockRows * kMostOpenBlocks];
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
  double& R(int row, int column) {
    const auto r = static_cast<std::size_t>(row);
    return r_[r * (r + 1) / 2 + static_cast<std::size_t>(column)];
  }
  double& Coupling(int row, int column) { return row < column ? R(column, row) : R(row, column); }
  // Calls act(block) for each open block.
  template <class Act>
  static void ForEach(std::uint64_t open, Act act) {
    for (int b = 0; open >> b != 0; ++b) {
      if ((open >> b & 1) != 0) act(b);
    }
  }

  std::vector<double> x_;
  std::vector<double> r_;
  std::vector<double> gradient_;
  std::vector<Eigen::Vector3d> force_N_;  // by block: of its contacts, for (14)
  std::vector<Control> control_;          // one, or none
};

/// Adds one side of a contact to the slot at row `at` of its curve, and leaves the other side to
/// another call. Both sides together are at least the contact's Hessian H: its coupling C of the
/// sides is replaced by (C C')^1/2 and (C'C)^1/2.
template <int kRows>
void AddEnd(const BetweenCurves::Terms& terms, int side, int curve, int at, Front<kRows>& front);

/// (C C')^1/2 of the side: the bound of its coupling.
Eigen::Matrix<double, 5, 5> BoundOfCoupling(const BetweenCurves::Matrix& hessian, int side);

template <int kRows>
void AddEnd(const BetweenCurves::Terms& terms, int side, int curve, int at, Front<kRows>& front) {
  const Eigen::Matrix<double, 5, 5> bound = BoundOfCoupling(terms.hessian, side);
  for (int a = 0; a < 5; ++a) {
    front.g[at + a] += terms.gradient[5 * side + a];
    for (int b = 0; b < 5; ++b) {
      front.p[at + a][at + b] += terms.hessian(5 * side + a, 5 * side + b) + bound(a, b);
    }
  }
  for (int d = 0; d < 3; ++d) front.force_N[curve][d] += terms.force[5 * side + d];
}

template <int kRows>
void OpenRows::Wait(const BetweenCurves::Terms& terms, int side, int block, int curve, int at,
                    Front<kRows>& front) {
  const int own = 5 * side;
  const int other = 5 - own;
  const int first = kBlockRows * block;
  for (int a = 0; a < kBlockRows; ++a) {
    front.g[at + a] += terms.gradient[own + a];
    gradient_[static_cast<std::size_t>(first + a)] += terms.gradient[other + a];
    for (int b = 0; b < kBlockRows; ++b) {
      front.p[at + a][at + b] += terms.hessian(own + a, own + b);
      X(first + a)[at + b] += terms.hessian(other + a, own + b);
    }
    for (int b = 0; b <= a; ++b) R(first + a, first + b) += terms.hessian(other + a, other + b);
  }
  for (int d = 0; d < 3; ++d) {
    front.force_N[curve][d] += terms.force[own + d];
    force_N_[static_cast<std::size_t>(block)][d] += terms.force[other + d];
  }
}

template <int kRows>
void OpenRows::Close(int block, std::uint64_t open, int curve, int at, Front<kRows>& front) {
  const int first = kBlockRows * block;
  for (int a = 0; a < kBlockRows; ++a) {
    const double* const x = X(first + a);
    for (int m = 0; m < kRows; ++m) {
      front.p[at + a][m] += x[m];
      front.p[m][at + a] += x[m];
    }
    for (int b = 0; b < kBlockRows; ++b) {
      front.p[at + a][at + b] += Coupling(first + a, first + b);
    }
    front.g[at + a] += gradient_[static_cast<std::size_t>(first + a)];
    ForEach(open, [&](int other) {
      for (int row = kBlockRows * other; row < kBlockRows * (other + 1); ++row) {
        X(row)[at + a] += Coupling(row, first + a);
      }
    });
  }
  for (int d = 0; d < 3; ++d) {
    front.force_N[curve][d] += force_N_[static_cast<std::size_t>(block)][d];
  }
}

}  // namespace torquer
