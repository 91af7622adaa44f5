#include "host/simulator/vessel/brick_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace torquer::vessel {

using Eigen::Array3i;
using Eigen::Vector3d;
using kernel::kCells;
using kernel::kPlane;
using kernel::kRow;

namespace {

constexpr int kSamples = kRow + 2;  // along an axis; the fit needs both neighbors
// Limit of the fit's second differences, in cell widths. At a ridge of the distance, the full
// correction would overshoot and make the field steeper than a distance. Walls of radius two cells
// or more are not affected.
constexpr double kSecondDifferenceLimit = 0.5;

// Weights of the three coarse coefficients about a cell for each of its four fine ones (Chaikin's
// subdivision, twice).
constexpr double kSubdivision[BrickLevels::kRatio][3] = {{6.0 / 16, 10.0 / 16, 0},
                                                         {3.0 / 16, 12.0 / 16, 1.0 / 16},
                                                         {1.0 / 16, 12.0 / 16, 3.0 / 16},
                                                         {0, 10.0 / 16, 6.0 / 16}};

// Coefficient of a fine cell, subdivided from the coarse level. corner: first coarse cell of the
// brick.
double Subdivide(const float* coarse, const Array3i& corner, const Array3i& fine) {
  const Array3i cell(fine.x() >> 2, fine.y() >> 2, fine.z() >> 2);
  const Array3i local = cell - corner;  // -1 to kCells
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    const double wz = kSubdivision[fine.z() & 3][c];
    if (wz == 0) continue;
    for (int b = 0; b < 3; ++b) {
      const double wy = wz * kSubdivision[fine.y() & 3][b];
      if (wy == 0) continue;
      const float* row = coarse + (local.z() + c) * kPlane + (local.y() + b) * kRow + local.x();
      for (int a = 0; a < 3; ++a) {
        const double weight = kSubdivision[fine.x() & 3][a];
        if (weight != 0) sum += wy * weight * static_cast<double>(row[a]);
      }
    }
  }
  return sum;
}

// Weight of the fit: 1 up to full, 0 from edge on, with two continuous derivatives.
double FineShare(double distance, double full, double edge) {
  const double x = std::clamp((distance - full) / (edge - full), 0.0, 1.0);
  return 1 - x * x * x * (10 + x * (6 * x - 15));
}

}  // namespace

BrickFit::BrickFit(const DistanceSource& source, const BrickLevels& levels, int level,
                   const Array3i& brick, float* coefficients)
    : level_(levels[level]), brick_(brick), coefficients_(coefficients) {
  const bool is_top = levels.IsTop(level);
  if (is_top || !IsFar(source, levels)) Sample(source, levels, is_top);
}

// True if a few distances show that no coefficient of the brick lies within its level's band.
bool BrickFit::IsFar(const DistanceSource& source, const BrickLevels& levels) const {
  const Array3i cell = brick_ * kCells;
  const Vector3d center =
      0.5 * (levels.CellCenter(level_, cell + 3) + levels.CellCenter(level_, cell + 4));
  const double half = 0.5 * (kRow - 1) * level_.cell_mm;
  if (std::abs(source.Distance(center)) >= level_.edge_mm + half * std::sqrt(3.0)) return true;
  const double third = half / 3;
  for (int k = -1; k <= 1; ++k) {
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        const Vector3d at = center + 2 * third * Vector3d(i, j, k);
        if (std::abs(source.Distance(at)) < level_.edge_mm + third * std::sqrt(3.0)) return false;
      }
    }
  }
  return true;
}

// Second-order fit: a cell's coefficient is the distance at its center, minus an eighth of the
// second differences.
void BrickFit::Sample(const DistanceSource& source, const BrickLevels& levels, bool is_top) {
  const Array3i corner = brick_ * kCells - 2;
  double axis[3][kSamples];
  for (int i = 0; i < kSamples; ++i) {
    const Vector3d at = levels.CellCenter(level_, corner + i);
    for (int a = 0; a < 3; ++a) axis[a][i] = at[a];
  }
  double samples[kSamples * kSamples * kSamples];
  // A sample counts if its own cell or a neighbor lies within the band.
  const double needed_mm =
      is_top ? std::numeric_limits<double>::infinity() : level_.edge_mm + level_.cell_mm;
  source.SampleGrid(axis[0], axis[1], axis[2], kSamples, needed_mm, samples);

  constexpr int kStride[3] = {1, kSamples, kSamples * kSamples};
  const double limit = kSecondDifferenceLimit * level_.cell_mm;
  int at = 0;
  for (int k = 1; k <= kRow; ++k) {
    for (int j = 1; j <= kRow; ++j) {
      for (int i = 1; i <= kRow; ++i, ++at) {
        const double* f = samples + (k * kSamples + j) * kSamples + i;
        double correction = 0;
        for (const int stride : kStride) {
          correction += std::clamp(f[-stride] - 2 * f[0] + f[stride], -limit, limit);
        }
        share_[at] = is_top ? 1 : FineShare(std::abs(f[0]), level_.full_mm, level_.edge_mm);
        least_share_ = std::min(least_share_, share_[at]);
        largest_share_ = std::max(largest_share_, share_[at]);
        coefficients_[at] = static_cast<float>(f[0] - correction / 8);
      }
    }
  }
  std::fill(coefficients_ + at, coefficients_ + kernel::kCoefficients, 0.0F);
}

void BrickFit::Blend(const float* coarse) {
  const Array3i corner = coarse_brick() * kCells;
  int at = 0;
  for (int k = -1; k <= kCells; ++k) {
    for (int j = -1; j <= kCells; ++j) {
      for (int i = -1; i <= kCells; ++i, ++at) {
        if (share_[at] == 1) continue;
        const double sum = Subdivide(coarse, corner, brick_ * kCells + Array3i(i, j, k));
        coefficients_[at] = static_cast<float>(share_[at] * static_cast<double>(coefficients_[at]) +
                                               (1 - share_[at]) * sum);
      }
    }
  }
}

}  // namespace torquer::vessel
