// The coefficients of one brick, fitted to the distance.
#pragma once

#include <Eigen/Core>

#include "host/simulator/vessel/brick_kernel.h"
#include "host/simulator/vessel/brick_levels.h"
#include "host/simulator/vessel/distance_source.h"

namespace torquer::vessel {

/// The fit of a brick. A pure function of the distance and of the brick's place, bit for bit.
///
/// Toward the edge of the level's band the coefficients pass over into the exact subdivision of the
/// next coarser level's, so that the levels make one function with a continuous gradient.
class BrickFit {
 public:
  /// Samples the distance, and writes the coefficients that it alone gives: kernel::kCoefficients.
  BrickFit(const DistanceSource& source, const BrickLevels& levels, int level,
           const Eigen::Array3i& brick, float* coefficients);

  /// False where no coefficient lies within the level's band: then there is no brick.
  bool is_active() const { return largest_share_ > 0; }
  /// Whether the coefficients of the brick around it on the next coarser level have a share.
  bool needs_coarse() const { return least_share_ < 1; }
  /// Place of that brick.
  Eigen::Array3i coarse_brick() const { return brick_ / BrickLevels::kRatio; }
  /// Mixes in its coefficients.
  void Blend(const float* coarse);

 private:
  bool IsFar(const DistanceSource& source, const BrickLevels& levels) const;
  void Sample(const DistanceSource& source, const BrickLevels& levels, bool is_top);

  const BrickLevels::Level& level_;
  const Eigen::Array3i brick_;
  float* const coefficients_;
  double share_[kernel::kRow * kernel::kRow * kernel::kRow];  // of the fit in a coefficient
  double least_share_ = 1;
  double largest_share_ = 0;
};

}  // namespace torquer::vessel
