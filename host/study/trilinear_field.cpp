#include "host/study/trilinear_field.h"

#include <cmath>

namespace torquer::study {

using Eigen::Array3d;
using Eigen::Array3i;
using Eigen::Vector3d;

TrilinearField::TrilinearField(const ClearanceField& source, double voxel_mm)
    : source_(source), voxel_mm_(voxel_mm) {}

const TrilinearField::Block& TrilinearField::BlockAt(const Array3i& block) const {
  constexpr int kHalf = 1 << 20;
  std::uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis) {
    key = key << 21 | static_cast<std::uint64_t>(block[axis] + kHalf);
  }
  std::unique_ptr<Block>& found = blocks_[key];
  if (found != nullptr) return *found;
  found = std::make_unique<Block>();
  std::size_t at = 0;
  for (int k = 0; k < kNodes; ++k) {
    for (int j = 0; j < kNodes; ++j) {
      for (int i = 0; i < kNodes; ++i) {
        const Array3i node = block * kEdge + Array3i(i, j, k);
        (*found)[at++] =
            static_cast<float>(source_.Clearance(node.cast<double>().matrix() * voxel_mm_));
      }
    }
  }
  return *found;
}

double TrilinearField::Clearance(const Vector3d& point_mm) const {
  ClearanceSample sample;
  EvaluateHessian(point_mm, sample);
  return sample.clearance_mm;
}

void TrilinearField::EvaluateGradient(const Vector3d& point_mm, ClearanceSample& out) const {
  ClearanceSample sample;
  EvaluateHessian(point_mm, sample);
  out.clearance_mm = sample.clearance_mm;
  out.gradient = sample.gradient;
}

void TrilinearField::EvaluateHessian(const Vector3d& point_mm, ClearanceSample& out) const {
  const Array3d place = point_mm.array() / voxel_mm_;
  const Array3i cell = place.floor().cast<int>();
  const Array3d t = place - cell.cast<double>();
  const Array3i block = (cell.cast<double>() / kEdge).floor().cast<int>();
  const Array3i inside = cell - block * kEdge;
  const Block& values = BlockAt(block);
  out = ClearanceSample();
  for (int corner = 0; corner < 8; ++corner) {
    const Array3i step(corner & 1, corner >> 1 & 1, corner >> 2);
    const Array3i node = inside + step;
    const double value =
        values[static_cast<std::size_t>((node.z() * kNodes + node.y()) * kNodes + node.x())];
    Vector3d weight;
    Vector3d slope;
    for (int axis = 0; axis < 3; ++axis) {
      weight[axis] = step[axis] ? t[axis] : 1 - t[axis];
      slope[axis] = (step[axis] ? 1 : -1) / voxel_mm_;
    }
    out.clearance_mm += value * weight.prod();
    for (int axis = 0; axis < 3; ++axis) {
      const int b = (axis + 1) % 3;
      const int c = (axis + 2) % 3;
      out.gradient[axis] += value * slope[axis] * weight[b] * weight[c];
      // Within a cell only the mixed second derivatives are nonzero.
      const double mixed = value * slope[b] * slope[c] * weight[axis];
      out.hessian(b, c) += mixed;
      out.hessian(c, b) += mixed;
    }
  }
}

}  // namespace torquer::study
