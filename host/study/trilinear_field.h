// Trilinear clearance field: linear between grid points, continuous, with a discontinuous gradient.
//
// Many simulators use such a field. It is a counterexample here: the accuracy study shows the
// effect of a discontinuous gradient on a relaxation.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>

#include "host/simulator/core/clearance_field.h"

namespace torquer::study {

class TrilinearField final : public ClearanceField {
 public:
  /// Samples `source` every voxel_mm, lazily around queried points. `source` must outlive this
  /// object. Not thread-safe.
  TrilinearField(const ClearanceField& source, double voxel_mm);

  double Clearance(const Eigen::Vector3d& point_mm) const override;
  void EvaluateGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override;
  void EvaluateHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override;
  double LipschitzBound() const override { return 1.8; }  // > sqrt(3): slopes <= 1 per axis

 private:
  static constexpr int kEdge = 8;  // cells along each edge of a block
  static constexpr int kNodes = kEdge + 1;
  using Block = std::array<float, kNodes * kNodes * kNodes>;

  const Block& BlockAt(const Eigen::Array3i& block) const;

  const ClearanceField& source_;
  double voxel_mm_;
  mutable std::unordered_map<std::uint64_t, std::unique_ptr<Block>> blocks_;
};

}  // namespace torquer::study
