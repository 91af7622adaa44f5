#include "host/simulator/core/newton/open_rows.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace torquer {

OpenRows::OpenRows(bool any, bool twist)
    : block_rows_(twist ? kMostBlockRows : CrossingTerms::kSteps) {
  if (!any) return;
  const int rows = block_rows_ * kMostOpenBlocks;
  x_.resize(rows * kMostFrontRows);
  r_.resize(rows * (rows + 1) / 2);
  gradient_.resize(rows);
  force_N_.resize(kMostOpenBlocks);
  control_.resize(1);
}

void OpenRows::Open(int block, std::uint64_t open) {
  const int first = block_rows_ * block;
  force_N_[block].setZero();
  for (int row = first; row < first + block_rows_; ++row) {
    gradient_[row] = 0;
    std::fill_n(X(row), kMostFrontRows, 0.0);
    ForEach(open, [&](int other) {
      for (int m = block_rows_ * other; m < block_rows_ * (other + 1); ++m) Coupling(row, m) = 0;
    });
    for (int m = first; m <= row; ++m) R(row, m) = 0;
  }
}

void OpenRows::Substitute(const FrontSegment& segment, int spins, int at, std::uint64_t open) {
  const int eta = at + 3;
  const int roll = at + 5;
  const double* const frame = segment.frame.data();  // by rows
  const bool follows = spins == 0 && segment.turn != nullptr;
  double(&f)[kMostControls][kMostBlockRows * kMostOpenBlocks] = control_.front().f;
  int k = 0;
  ForEach(open, [&](int block) {
    for (int row = block_rows_ * block; row < block_rows_ * (block + 1); ++row, ++k) {
      double* const x = X(row);
      for (int a = 0; a < 2; ++a) {
        double sum = x[eta + a];
        for (int d = 0; d < 3; ++d) sum += segment.length_mm * frame[2 * d + a] * x[at + d];
        if (follows) sum += segment.turn->distal[a] * x[roll];
        f[a][k] = sum;
      }
      for (int m = 0; m < spins; ++m) f[2 + m][k] = x[roll + m];
      for (int a = 0; a < 2; ++a) x[eta + a] = follows ? segment.turn->proximal[a] * x[roll] : 0;
      for (int m = 0; m < spins; ++m) x[roll + m] = 0;
    }
  });
}

void OpenRows::Eliminate(const FrontGain& gain, const PivotInverse& inverse, int controls, int rows,
                         std::uint64_t open, double* gains) {
  const double(&f)[kMostControls][kMostBlockRows * kMostOpenBlocks] = control_.front().f;
  const int count = block_rows_ * std::popcount(open);
  for (int c = 0; c < controls; ++c) {
    double* const of = gains + static_cast<std::ptrdiff_t>(c) * count;
    for (int k = 0; k < count; ++k) {
      double sum = 0;
      for (int d = 0; d < controls; ++d) sum += inverse.of[c][d] * f[d][k];
      of[k] = sum;
    }
  }
  int k = 0;
  ForEach(open, [&](int block) {
    for (int row = block_rows_ * block; row < block_rows_ * (block + 1); ++row, ++k) {
      double* const x = X(row);
      double& gradient = gradient_[row];
      for (int c = 0; c < controls; ++c) {
        const double with = f[c][k];
        gradient -= with * gain.constant[c];
        for (int m = 0; m < rows; ++m) x[m] -= with * gain.of_slots[c][m];
      }
      int column_at = 0;
      ForEach(open, [&](int other) {
        if (other > block) return;
        const int end = std::min(row, block_rows_ * other + block_rows_ - 1);
        for (int column = block_rows_ * other; column <= end; ++column) {
          double sum = 0;
          for (int c = 0; c < controls; ++c) {
            sum += f[c][k] * gains[c * count + column_at + column - block_rows_ * other];
          }
          R(row, column) -= sum;
        }
        column_at += block_rows_;
      });
    }
  });
}

namespace {

template <int kSize>
BoundMatrix Bound(const CrossingTerms& terms, int side) {
  using Block = Eigen::Matrix<double, kSize, kSize>;
  Block coupling;
  for (int a = 0; a < kSize; ++a) {
    for (int b = 0; b < kSize; ++b) coupling(a, b) = terms.Hessian(side, a, 1 - side, b);
  }
  const Block squared = coupling * coupling.transpose();
  const Eigen::SelfAdjointEigenSolver<Block> solver(squared);
  BoundMatrix bound = BoundMatrix::Zero();
  bound.topLeftCorner<kSize, kSize>() = solver.eigenvectors() *
                                        solver.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() *
                                        solver.eigenvectors().transpose();
  return bound;
}

}  // namespace

BoundMatrix BoundOfCoupling(const CrossingTerms& terms, int side) {
  return terms.spins == nullptr ? Bound<CrossingTerms::kSteps>(terms, side)
                                : Bound<CrossingTerms::kSteps + 1>(terms, side);
}

}  // namespace torquer
