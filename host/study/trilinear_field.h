// A clearance field that is linear between grid points: continuous, with a gradient that jumps.
//
// What many simulators use, and a counterexample here: the study of accuracy shows what a field
// without a continuous gradient does to a relaxation.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>

#include "host/simulator/core/clearance_field.h"

namespace torquer::study {

class TrilinearField final : public ClearanceField {
 public:
  /// Samples `source`, which must outlive it, every voxel_mm; where it is looked at. For one
  /// thread.
  TrilinearField(const ClearanceField& source, double voxel_mm);

  double Clearance(const Eigen::Vector3d& point_mm) const override;
  void EvaluateGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override;
  void EvaluateHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override;
  double LipschitzBound() const override { return 1.8; }  // sqrt(3), of slopes up to 1 an axis

 private:
  static constexpr int kEdge = 8;  // cells of a block
  static constexpr int kNodes = kEdge + 1;
  using Block = std::array<float, kNodes * kNodes * kNodes>;

  const Block& BlockAt(const Eigen::Array3i& block) const;

  const ClearanceField& source_;
  double voxel_mm_;
  mutable std::unordered_map<std::uint64_t, std::unique_ptr<Block>> blocks_;
};

}  // namespace torquer::study
