// A clearance field of quadratic B-spline bricks in nested levels, built where it is looked at.
//
//   level 0 (voxel)   level 1 (4 voxels)   level 2 (16) ..    top: everywhere, 200 mm around
//   ####              . . . .              .       .
//   #### near wall    . . . . less near    .       .   far
//
// A level's bricks of 8^3 cells exist where the wall is within its band. Toward the band's edge the
// coefficients pass over into the exact subdivision of the next coarser level's, so the field is
// one function with a continuous gradient. A brick is a pure function of the distance it is fitted
// to and of its place: when, by whom and in which order bricks are built changes nothing.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/brick_kernel.h"
#include "host/simulator/vessel/distance_source.h"

namespace torquer::vessel {

struct BrickFieldOptions {
  /// Cell width of the finest level, mm, 0.02 to 4. A lumen narrower than four voxels, or a wall
  /// between two lumens thinner than one, is not resolved.
  double voxel_mm = 0.25;
  /// The finest level holds undiluted within this distance of the wall, mm.
  double band_mm = 1.5;
  /// How far beyond the vessel's box the field is fitted, mm; further out it is continued.
  double margin_mm = 200;
  /// Most memory that bricks may take; so much address space may the index take, too.
  size_t memory_limit_bytes = size_t{4} << 30;
};

/// What a field has built and what that takes.
struct BrickFieldStatistics {
  int levels = 0;
  std::vector<size_t> bricks;  ///< by level, finest first; those of a cache file included
  size_t bricks_built = 0;     ///< by this object, not taken from a cache
  size_t brick_bytes = 0;      ///< on the heap
  size_t index_bytes = 0;      ///< address space; pages never looked at take no memory
};

class BrickField final : public ClearanceField {
 public:
  /// source: the distance; its zero lies within bounds_mm. Throws UserError on options out of range
  /// and on a vessel too large for them. A look-up that would build a brick beyond the memory limit
  /// throws UserError.
  BrickField(std::shared_ptr<const DistanceSource> source, const Eigen::AlignedBox3d& bounds_mm,
             const BrickFieldOptions& options);
  ~BrickField() override;

  /// A field from any function that is nowhere steeper than 1 and whose zero lies within bounds_mm.
  static std::unique_ptr<BrickField> FromFunction(
      std::function<double(const Eigen::Vector3d&)> function, const Eigen::AlignedBox3d& bounds_mm,
      const BrickFieldOptions& options = {});

  double Clearance(const Eigen::Vector3d& point_mm) const override { return Look(point_mm); }
  void EvaluateGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override {
    LookGradient(point_mm, out);
  }
  void EvaluateHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override {
    LookHessian(point_mm, out);
  }
  double LipschitzBound() const override { return kLipschitzBound; }

  // The same without a virtual call. The point must be finite.
  inline double Look(const Eigen::Vector3d& point_mm) const;
  inline void LookGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const;
  inline void LookHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const;

  /// Builds whatever look-ups within radius_mm of a point will need. Safe beside look-ups and other
  /// calls of itself: meant for a thread that runs ahead of the wire.
  void Prefetch(const Eigen::Vector3d& point_mm, double radius_mm) const;

  /// Builds every brick of the levels from the coarsest down to finest_level (0: all), on that many
  /// threads; returns whether it came to its end before a stop was asked for.
  bool Build(int finest_level, int threads, std::stop_token stop = {}) const;

  const BrickFieldOptions& options() const { return options_; }
  const Eigen::AlignedBox3d& bounds_mm() const { return bounds_mm_; }
  int level_count() const { return static_cast<int>(levels_.size()); }
  BrickFieldStatistics Statistics() const;

  /// A brick as a cache file keeps it.
  struct StoredBrick {
    int32_t level;
    int32_t place[3];
    /// kernel::kCoefficients of them, in a cache file followed by their Checksum.
    const float* coefficients;
  };
  /// All bricks that exist now.
  std::vector<StoredBrick> StoredBricks() const;
  /// Bricks of a level that exist are all that will (the others are known to be inactive).
  bool IsComplete(int level) const { return levels_[level].complete.load(); }
  /// Takes over bricks of an earlier run of the same source and options. They stay where they are:
  /// `keep` holds that memory alive. Each is checked against its checksum when first looked at, and
  /// built anew if it does not agree. Before the first look-up only.
  void Adopt(const std::vector<StoredBrick>& bricks, const std::vector<bool>& complete_levels,
             std::shared_ptr<const void> keep);
  static uint64_t Checksum(const StoredBrick& brick);

 private:
  // An entry of a level's index: 0 unknown, kInactive, coefficients + 1, or coefficients + 2 while
  // they wait for their check.
  using Entry = uintptr_t;
  static constexpr Entry kUnknown = 0, kInactive = 2;
  // Measured: 1.2 on real meshes, at the ridges of small vessels; a distance itself has 1.
  static constexpr double kLipschitzBound = 1.3;
  static constexpr double kFarMm = 20;  // over which the slope beyond the box turns to -1

  struct Level {
    double cells_per_mm = 0;
    Eigen::Array3d low, high;  // in cells from the origin
    // Entry of brick (i, j, k): k stride_z + j stride_y + i - offset.
    ptrdiff_t stride_y = 0, stride_z = 0, offset = 0;
    Entry* index = nullptr;
    double cell_mm = 0;
    Eigen::Array3i first, count;      // bricks
    double full_mm = 0, edge_mm = 0;  // fit undiluted within full, gone beyond edge
    mutable std::atomic<bool> complete{false};
  };
  struct Brick {
    float coefficients[kernel::kCoefficients];
    int32_t level;
    int32_t place[3];
    Brick* next;
  };
  struct FreeIndex {
    void operator()(Entry* index) const;
  };

  // Where a point lies in a level: its cell, from the cell's center, and its brick's index.
  struct Place {
    int x, y, z;
    double tx, ty, tz;
    ptrdiff_t index;
  };
  // What the spline needs: the first of 27 coefficients (null: outside of all levels).
  struct Cell {
    const float* corner;
    double tx, ty, tz;
    double per_mm;
  };
  inline bool PlaceOf(const Level& level, const Eigen::Vector3d& p, Place& place) const;
  static inline Cell CellOf(const Level& level, const Place& place, Entry entry);
  inline Cell Locate(const Eigen::Vector3d& p) const;
  __attribute__((noinline)) Cell LocateAnywhere(const Eigen::Vector3d& p) const;
  template <int kOrder>
  inline bool Evaluate(const Eigen::Vector3d& point_mm, kernel::Jet& jet, double& per_mm) const;
  void EvaluateBeyond(const Eigen::Vector3d& point_mm, ClearanceSample& out) const;

  static ptrdiff_t IndexOf(const Level& level, const Eigen::Array3i& brick) {
    return brick.z() * level.stride_z + brick.y() * level.stride_y + brick.x() - level.offset;
  }
  static bool InIndex(const Level& level, const Eigen::Array3i& brick) {
    return (brick >= level.first).all() && (brick < level.first + level.count).all();
  }
  // Coefficients of a brick, built if need be; null where it is inactive.
  const float* Ensure(int level, const Eigen::Array3i& brick) const;
  __attribute__((noinline)) Entry Resolve(int level, const Eigen::Array3i& brick) const;
  bool Fit(int level, const Eigen::Array3i& brick, float* coefficients) const;
  bool IsFar(int level, const Eigen::Array3i& brick) const;
  Eigen::Vector3d CellCenter(const Level& level, const Eigen::Array3i& cell) const;

  std::shared_ptr<const DistanceSource> source_;
  BrickFieldOptions options_;
  Eigen::AlignedBox3d bounds_mm_;
  Eigen::AlignedBox3d domain_mm_;
  Eigen::Vector3d origin_mm_;
  std::vector<Level> levels_;
  std::vector<std::unique_ptr<Entry, FreeIndex>> indices_;
  std::shared_ptr<const void> adopted_memory_;
  std::vector<StoredBrick> adopted_;
  mutable std::atomic<Brick*> built_{nullptr};
  mutable std::atomic<size_t> built_count_{0};
};

inline bool BrickField::PlaceOf(const Level& level, const Eigen::Vector3d& p, Place& place) const {
  const double x = (p.x() - origin_mm_.x()) * level.cells_per_mm,
               y = (p.y() - origin_mm_.y()) * level.cells_per_mm,
               z = (p.z() - origin_mm_.z()) * level.cells_per_mm;
  if (!(x >= level.low.x() && x < level.high.x() && y >= level.low.y() && y < level.high.y() &&
        z >= level.low.z() && z < level.high.z())) {
    return false;
  }
  place.x = static_cast<int>(x);
  place.y = static_cast<int>(y);
  place.z = static_cast<int>(z);
  place.tx = x - place.x - 0.5;
  place.ty = y - place.y - 0.5;
  place.tz = z - place.z - 0.5;
  place.index = (place.z >> 3) * level.stride_z + (place.y >> 3) * level.stride_y + (place.x >> 3) -
                level.offset;
  return true;
}

inline BrickField::Cell BrickField::CellOf(const Level& level, const Place& place, Entry entry) {
  return {reinterpret_cast<const float*>(entry - 1) + (place.z & 7) * kernel::kPlane +
              (place.y & 7) * kernel::kRow + (place.x & 7),
          place.tx, place.ty, place.tz, level.cells_per_mm};
}

inline BrickField::Cell BrickField::Locate(const Eigen::Vector3d& p) const {
  // The finest level first: near the wall it answers, and all else stays out of its way.
  const Level& finest = levels_.front();
  Place place;
  if (PlaceOf(finest, p, place)) [[likely]] {
    const Entry entry =
        std::atomic_ref<Entry>(finest.index[place.index]).load(std::memory_order_acquire);
    if ((entry & 1) != 0) [[likely]]
      return CellOf(finest, place, entry);
  }
  return LocateAnywhere(p);
}

template <int kOrder>
inline bool BrickField::Evaluate(const Eigen::Vector3d& point_mm, kernel::Jet& jet,
                                 double& per_mm) const {
  const Cell cell = Locate(point_mm);
  if (cell.corner == nullptr) [[unlikely]]
    return false;
  kernel::Evaluate<kOrder>(cell.corner, cell.tx, cell.ty, cell.tz, jet);
  per_mm = cell.per_mm;
  return true;
}

inline double BrickField::Look(const Eigen::Vector3d& point_mm) const {
  kernel::Jet jet;
  double per_mm;
  if (Evaluate<0>(point_mm, jet, per_mm)) [[likely]]
    return jet.value;
  ClearanceSample beyond;
  EvaluateBeyond(point_mm, beyond);
  return beyond.clearance_mm;
}

inline void BrickField::LookGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const {
  kernel::Jet jet;
  double per_mm;
  if (Evaluate<1>(point_mm, jet, per_mm)) [[likely]] {
    out.clearance_mm = jet.value;
    out.gradient << jet.d[0] * per_mm, jet.d[1] * per_mm, jet.d[2] * per_mm;
    return;
  }
  EvaluateBeyond(point_mm, out);
}

inline void BrickField::LookHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const {
  kernel::Jet jet;
  double per_mm;
  if (Evaluate<2>(point_mm, jet, per_mm)) [[likely]] {
    out.clearance_mm = jet.value;
    out.gradient << jet.d[0] * per_mm, jet.d[1] * per_mm, jet.d[2] * per_mm;
    const double s = per_mm * per_mm;
    const double xy = jet.dd[3] * s, xz = jet.dd[4] * s, yz = jet.dd[5] * s;
    out.hessian << jet.dd[0] * s, xy, xz, xy, jet.dd[1] * s, yz, xz, yz, jet.dd[2] * s;
    return;
  }
  EvaluateBeyond(point_mm, out);
  // Out there no one needs more than differences.
  constexpr double kStep = 1e-3;
  ClearanceSample plus, minus;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
    LookGradient(point_mm + step, plus);
    LookGradient(point_mm - step, minus);
    out.hessian.col(axis) = (plus.gradient - minus.gradient) / (2 * kStep);
  }
  out.hessian = (0.5 * (out.hessian + out.hessian.transpose())).eval();
}

}  // namespace torquer::vessel
