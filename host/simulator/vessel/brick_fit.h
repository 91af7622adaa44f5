// Brick fit: the coefficients of one brick, fitted to the distance.
#pragma once

#include <Eigen/Core>

#include "host/simulator/vessel/brick_kernel.h"
#include "host/simulator/vessel/brick_levels.h"
#include "host/simulator/vessel/distance_source.h"

namespace torquer::vessel {

/// Fit of a brick: a pure function of the distance and of the brick's place, bit for bit.
///
/// Toward the edge of the level's band, the coefficients change into the exact subdivision of the
/// next coarser level's. Thus the levels form one function with a continuous gradient.
class BrickFit {
 public:
  /// Samples the distance and writes its own fit, without the coarser level, to
  /// kernel::kCoefficients coefficients.
  BrickFit(const DistanceSource& source, const BrickLevels& levels, int level,
           const Eigen::Array3i& brick, float* coefficients);

  /// False if no coefficient lies within the level's band; there is then no brick.
  bool is_active() const { return largest_share_ > 0; }
  /// True if the enclosing brick on the next coarser level contributes to the coefficients.
  bool needs_coarse() const { return least_share_ < 1; }
  /// Place of the enclosing coarser brick.
  Eigen::Array3i coarse_brick() const { return brick_ / BrickLevels::kRatio; }
  /// Blends in the coefficients of the coarser brick.
  void Blend(const float* coarse);

 private:
  bool IsFar(const DistanceSource& source, const BrickLevels& levels) const;
  void Sample(const DistanceSource& source, const BrickLevels& levels, bool is_top);

  const BrickLevels::Level& level_;
  const Eigen::Array3i brick_;
  float* const coefficients_;
  double share_[kernel::kRow * kernel::kRow * kernel::kRow];  // weights of the fit
  double least_share_ = 1;
  double largest_share_ = 0;
};

}  // namespace torquer::vessel
