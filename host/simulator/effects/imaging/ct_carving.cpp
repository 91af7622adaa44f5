#include "host/simulator/effects/imaging/ct_carving.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace torquer::effects {

using Eigen::Vector3d;
using Eigen::Vector3i;

namespace {

constexpr int kBlock = 8;               // voxels along the side of a block
constexpr double kReach = 3;            // of the blur, in its standard deviations
constexpr float kFull = 255;            // coverage of a voxel in the lumen
constexpr double kLeastMeasured = 0.3;  // share in the lumen of a voxel that shows the agent

// Voxels of a volume about a lumen.
struct Box {
  Vector3i low = Vector3i::Zero();
  Vector3i size = Vector3i::Zero();
  bool IsEmpty() const { return (size.array() <= 0).any(); }
  std::size_t At(int i, int j, int k) const {
    return static_cast<std::size_t>(i) +
           static_cast<std::size_t>(size[0]) *
               (static_cast<std::size_t>(j) +
                static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(k));
  }
  std::size_t Count() const { return At(0, 0, size[2]); }
};

Box BoxOf(const Eigen::AlignedBox3d& bounds_mm, double beyond_mm, const CtVolume& volume) {
  const Eigen::Matrix3d to_index = volume.step_mm.inverse();
  Eigen::AlignedBox3d indices;
  for (int corner = 0; corner < 8; ++corner) {
    const auto at = static_cast<Eigen::AlignedBox3d::CornerType>(corner);
    indices.extend(to_index * (bounds_mm.corner(at) - volume.first_mm));
  }
  Box box;
  for (int a = 0; a < 3; ++a) {
    const double beyond = beyond_mm / volume.step_mm.col(a).norm();
    const auto last = static_cast<double>(volume.size[static_cast<std::size_t>(a)] - 1);
    const double low = std::clamp(std::floor(indices.min()[a] - beyond), 0.0, last + 1);
    const double high = std::clamp(std::ceil(indices.max()[a] + beyond), -1.0, last);
    box.low[a] = static_cast<int>(low);
    box.size[a] = static_cast<int>(high - low) + 1;
  }
  return box;
}

// Field over a box in cells of kBlock voxels.
struct Blocks {
  explicit Blocks(const Box& box) {
    for (int a = 0; a < 3; ++a) size.size[a] = (box.size[a] + kBlock - 1) / kBlock;
    sum.assign(size.Count(), 0);
    weight.assign(size.Count(), 0);
  }
  Box size;
  std::vector<double> sum, weight;
};

class Carver {
 public:
  Carver(const CtLumen& lumen, double blur_mm, const Box& box, CtVolume& volume)
      : lumen_(lumen),
        blur_mm_(blur_mm),
        box_(box),
        volume_(volume),
        strides_(volume.Strides()),
        voxel_mm_(std::cbrt(std::abs(volume.step_mm.determinant()))),
        agent_(box),
        covered_(box.Count(), 0),
        slice_(static_cast<std::size_t>(box.size[0]) * static_cast<std::size_t>(box.size[1])),
        scratch_(slice_.size()) {
    for (int a = 0; a < 3; ++a) MakeKernel(volume.step_mm.col(a).norm(), kernels_[At(a)]);
  }

  void Carve() {
    for (int k = 0; k < box_.size[2]; k += kBlock) {
      for (int j = 0; j < box_.size[1]; j += kBlock) {
        for (int i = 0; i < box_.size[0]; i += kBlock) CoverBlock({i, j, k});
      }
    }
    for (int k = 0; k < box_.size[2]; ++k) {
      if (BlurSlice(k)) MeasureSlice(k);
    }
    SpreadAgent();
    for (int k = 0; k < box_.size[2]; ++k) {
      if (BlurSlice(k)) SubtractSlice(k);
    }
  }

 private:
  static std::size_t At(int axis) { return static_cast<std::size_t>(axis); }

  void MakeKernel(double step_mm, std::vector<float>& kernel) const {
    const double sigma = blur_mm_ / step_mm;
    const int reach = static_cast<int>(std::ceil(kReach * sigma));
    double sum = 0;
    for (int n = -reach; n <= reach; ++n) {
      kernel.push_back(static_cast<float>(std::exp(-0.5 * n * n / std::max(1e-12, sigma * sigma))));
      sum += static_cast<double>(kernel.back());
    }
    for (float& value : kernel) value /= static_cast<float>(sum);
  }

  Vector3d PlaceOf(const Vector3d& index) const {
    return volume_.first_mm + volume_.step_mm * (box_.low.cast<double>() + index);
  }
  std::int16_t* RowOf(int j, int k) const {
    return volume_.values.data() + box_.low[0] + (box_.low[1] + j) * strides_[1] +
           (box_.low[2] + k) * strides_[2];
  }

  // Finds the share of each voxel in the lumen.
  void CoverBlock(const Vector3i& first) {
    const Vector3i count = (box_.size - first).cwiseMin(kBlock);
    const Vector3d half = (count.cast<double>() - Vector3d::Ones()) / 2;
    const double reach_mm =
        lumen_.steepest * (volume_.step_mm.cwiseAbs() * half).norm() + voxel_mm_;
    const double middle_mm = lumen_.clearance(PlaceOf(first.cast<double>() + half));
    if (middle_mm < -reach_mm) return;
    const bool is_inside = middle_mm > reach_mm;
    for (int k = first[2]; k < first[2] + count[2]; ++k) {
      for (int j = first[1]; j < first[1] + count[1]; ++j) {
        for (int i = first[0]; i < first[0] + count[0]; ++i) {
          const double depth_mm =
              is_inside ? middle_mm : lumen_.clearance(PlaceOf(Vector3d(i, j, k)));
          const double share = std::clamp(0.5 + depth_mm / voxel_mm_, 0.0, 1.0);
          covered_[box_.At(i, j, k)] = static_cast<std::uint8_t>(std::lround(share * 255));
        }
      }
    }
  }

  // Measures the agent in a slice. Deep voxels decide, because bone may lie beside the lumen.
  void MeasureSlice(int k) {
    for (int j = 0; j < box_.size[1]; ++j) {
      const std::int16_t* const row = RowOf(j, k);
      const float* const shares = &slice_[box_.At(0, j, 0)];
      for (int i = 0; i < box_.size[0]; ++i) {
        const double share = static_cast<double>(shares[i]);
        if (share < kLeastMeasured) continue;
        const double weight = share * share * share * share;
        const std::size_t block = agent_.size.At(i / kBlock, j / kBlock, k / kBlock);
        agent_.sum[block] += weight * (row[i] - kBloodHu);
        agent_.weight[block] += weight * share;
      }
    }
  }

  // Smooths the measured agent over neighbors, and fills the blocks without any from theirs.
  void SpreadAgent() {
    for (int a = 0; a < 3; ++a) {
      SmoothAlong(a, agent_.sum);
      SmoothAlong(a, agent_.weight);
    }
    for (std::size_t n = 0; n < agent_.sum.size(); ++n) {
      if (agent_.weight[n] > 0) agent_.sum[n] /= agent_.weight[n];
    }
  }
  void SmoothAlong(int axis, std::vector<double>& values) const {
    const Box& size = agent_.size;
    const std::vector<double> before = values;
    Vector3i at;
    for (at[2] = 0; at[2] < size.size[2]; ++at[2]) {
      for (at[1] = 0; at[1] < size.size[1]; ++at[1]) {
        for (at[0] = 0; at[0] < size.size[0]; ++at[0]) {
          double& value = values[size.At(at[0], at[1], at[2])];
          for (const int step : {-1, 1}) {
            Vector3i other = at;
            other[axis] += step;
            if (other[axis] < 0 || other[axis] >= size.size[axis]) continue;
            value += 0.5 * before[size.At(other[0], other[1], other[2])];
          }
        }
      }
    }
  }

  // Agent at a voxel, interpolated between the middles of blocks with agent.
  float AgentAt(int i, int j, int k) const {
    const Vector3d at = (Vector3d(i, j, k) - Vector3d::Constant((kBlock - 1) / 2.0)) / kBlock;
    const Vector3i low = at.array().floor().cast<int>();
    double sum = 0;
    double weight = 0;
    for (int corner = 0; corner < 8; ++corner) {
      double share = 1;
      Vector3i cell;
      for (int a = 0; a < 3; ++a) {
        const int step = (corner >> a) & 1;
        const double beyond = at[a] - low[a];
        share *= step == 1 ? beyond : 1 - beyond;
        cell[a] = std::clamp(low[a] + step, 0, agent_.size.size[a] - 1);
      }
      const std::size_t n = agent_.size.At(cell[0], cell[1], cell[2]);
      if (agent_.weight[n] == 0) continue;
      sum += share * agent_.sum[n];
      weight += share;
    }
    return weight > 0 ? static_cast<float>(sum / weight) : 0.0F;
  }

  // Blurs the coverage into slice_, along slices first. Returns false if there is none.
  bool BlurSlice(int k) {
    std::fill(slice_.begin(), slice_.end(), 0.0F);
    const auto reach = static_cast<int>(kernels_[2].size() / 2);
    for (int n = -reach; n <= reach; ++n) {
      if (k + n < 0 || k + n >= box_.size[2]) continue;
      const float share = kernels_[2][At(n + reach)] / kFull;
      const std::uint8_t* const from = &covered_[box_.At(0, 0, k + n)];
      for (std::size_t m = 0; m < slice_.size(); ++m) {
        slice_[m] += share * static_cast<float>(from[m]);
      }
    }
    if (std::none_of(slice_.begin(), slice_.end(), [](float f) { return f > 0; })) return false;
    BlurColumns();
    BlurRows();
    return true;
  }

  void SubtractSlice(int k) {
    for (int j = 0; j < box_.size[1]; ++j) {
      std::int16_t* const row = RowOf(j, k);
      const float* const share = &slice_[box_.At(0, j, 0)];
      for (int i = 0; i < box_.size[0]; ++i) {
        constexpr float kLeast = 0.002F;
        if (share[i] < kLeast) continue;
        const float left = static_cast<float>(row[i]) - share[i] * AgentAt(i, j, k);
        row[i] = static_cast<std::int16_t>(std::lround(std::clamp(left, -32768.0F, 32767.0F)));
      }
    }
  }

  // Adds `share` of `count` values.
  static void AddShare(float share, const float* from, std::size_t count, float* to) {
    for (std::size_t m = 0; m < count; ++m) to[m] += share * from[m];
  }
  void BlurColumns() {
    scratch_.swap(slice_);
    std::fill(slice_.begin(), slice_.end(), 0.0F);
    const auto reach = static_cast<int>(kernels_[1].size() / 2);
    for (int n = -reach; n <= reach; ++n) {
      const int first = std::max(0, -n);
      const int count = box_.size[1] - std::abs(n);
      if (count <= 0) continue;
      AddShare(kernels_[1][At(n + reach)], &scratch_[box_.At(0, first + n, 0)],
               box_.At(0, count, 0), &slice_[box_.At(0, first, 0)]);
    }
  }
  void BlurRows() {
    scratch_.swap(slice_);
    std::fill(slice_.begin(), slice_.end(), 0.0F);
    const auto reach = static_cast<int>(kernels_[0].size() / 2);
    for (int j = 0; j < box_.size[1]; ++j) {
      for (int n = -reach; n <= reach; ++n) {
        const int first = std::max(0, -n);
        const int count = box_.size[0] - std::abs(n);
        if (count <= 0) continue;
        AddShare(kernels_[0][At(n + reach)], &scratch_[box_.At(first + n, j, 0)], At(count),
                 &slice_[box_.At(first, j, 0)]);
      }
    }
  }

  const CtLumen& lumen_;
  const double blur_mm_;
  const Box& box_;
  CtVolume& volume_;
  const std::array<std::ptrdiff_t, 3> strides_;
  const double voxel_mm_;
  Blocks agent_;                       // weighted sums, later means, of the agent's HU
  std::vector<std::uint8_t> covered_;  // share of each voxel of the box in the lumen
  std::vector<float> slice_, scratch_;
  std::array<std::vector<float>, 3> kernels_;
};

}  // namespace

bool Overlaps(const CtLumen& lumen, const CtVolume& volume) {
  return !BoxOf(lumen.bounds_mm, 0, volume).IsEmpty();
}

void CarveLumen(const CtLumen& lumen, double blur_mm, CtVolume& volume) {
  const double beyond_mm = 2 * kReach * blur_mm + volume.step_mm.colwise().norm().maxCoeff();
  const Box box = BoxOf(lumen.bounds_mm, beyond_mm, volume);
  if (box.IsEmpty()) return;
  Carver(lumen, blur_mm, box, volume).Carve();
}

}  // namespace torquer::effects
