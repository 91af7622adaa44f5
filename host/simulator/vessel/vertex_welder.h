// Vertex welder: merges points that nearly coincide.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

namespace torquer::vessel {

/// Numbers points; a point within tolerance_mm of an earlier one gets its number.
class VertexWelder {
 public:
  /// tolerance_mm: above 0.
  explicit VertexWelder(double tolerance_mm) : tolerance_mm_(tolerance_mm) {}

  int32_t Add(const Eigen::Vector3d& p) {
    std::array<int64_t, 3> cell;
    for (int a = 0; a < 3; ++a) cell[a] = static_cast<int64_t>(std::floor(p[a] / tolerance_mm_));
    for (int n = 0; n < 27; ++n) {
      const auto near =
          cells_.find({cell[0] + n % 3 - 1, cell[1] + n / 3 % 3 - 1, cell[2] + n / 9 - 1});
      if (near == cells_.end()) continue;
      for (const int32_t other : near->second) {
        if ((points_mm_[other] - p).norm() <= tolerance_mm_) return other;
      }
    }
    const auto number = static_cast<int32_t>(points_mm_.size());
    points_mm_.push_back(p);
    cells_[cell].push_back(number);
    return number;
  }

  const std::vector<Eigen::Vector3d>& points_mm() const { return points_mm_; }
  /// The points, by number. The welder must not be used afterwards.
  std::vector<Eigen::Vector3d> Take() { return std::move(points_mm_); }

 private:
  struct Hash {
    size_t operator()(const std::array<int64_t, 3>& cell) const {
      uint64_t hash = 0;
      for (const int64_t c : cell) hash = (hash ^ static_cast<uint64_t>(c)) * 0x9e3779b97f4a7c15;
      return hash ^ (hash >> 32);
    }
  };

  double tolerance_mm_;
  std::vector<Eigen::Vector3d> points_mm_;
  std::unordered_map<std::array<int64_t, 3>, std::vector<int32_t>, Hash> cells_;
};

}  // namespace torquer::vessel
