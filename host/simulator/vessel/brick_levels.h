// Brick levels: the nested levels of a brick field, with the places of their cells. An index has an
// entry for each brick.
//
//   level 0 (voxel)   level 1 (4 voxels)   level 2 (16) ..    top: everywhere, 200 mm around
//   ####              . . . .              .       .
//   #### near wall    . . . . less near    .       .   far
//
// A level has a brick of 8^3 cells at each place with the wall within the level's band.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "host/simulator/vessel/brick_kernel.h"

namespace torquer::vessel {

struct BrickFieldOptions {
  /// Cell width of the finest level, mm, 0.02 to 4. A lumen narrower than four voxels, or a wall
  /// between two lumens thinner than one, is not resolved.
  double voxel_mm = 0.25;
  /// Distance from the wall up to which the finest level is not blended, mm, above 0 to 100. It is
  /// at least three voxels.
  double band_mm = 1.5;
  /// Distance around the vessel's box within which the field is fitted, mm, 0 to 10000. It is
  /// continued further out.
  double margin_mm = 200;
  /// Largest memory of the bricks, and largest address space of the index.
  size_t memory_limit_bytes = size_t{4} << 30;
};

class BrickLevels {
 public:
  /// State of a brick: kUnknown, kInactive (the wall is outside of its level's band), or an
  /// address. The address of its coefficients + 1 is odd and means usable; + 2 means that they
  /// await their check.
  using Entry = uintptr_t;
  static constexpr Entry kUnknown = 0, kInactive = 2;
  static bool IsUsable(Entry entry) { return (entry & 1) != 0; }

  static constexpr int kRatio = 4;  ///< ratio of the cell widths of neighboring levels

  struct Level {
    double cells_per_mm = 0;
    Eigen::Array3d low, high;  ///< bounds of the level's bricks, in cells from the origin
    /// Index of the entry of brick (i, j, k): k stride_z + j stride_y + i - offset.
    ptrdiff_t stride_y = 0, stride_z = 0, offset = 0;
    Entry* index = nullptr;
    double cell_mm = 0;
    Eigen::Array3i first, count;      ///< in bricks
    double full_mm = 0, edge_mm = 0;  ///< fit unblended up to full, absent from edge on

    ptrdiff_t IndexOf(const Eigen::Array3i& brick) const {
      return brick.z() * stride_z + brick.y() * stride_y + brick.x() - offset;
    }
    bool Contains(const Eigen::Array3i& brick) const {
      return (brick >= first).all() && (brick < first + count).all();
    }
  };

  /// Place of a point in a level: cell, offset from the cell's center in cells, and index of its
  /// brick.
  struct Place {
    int x, y, z;
    double tx, ty, tz;
    ptrdiff_t index;
  };

  /// Throws UserError if options are out of range or the vessel is too large for them.
  BrickLevels(const Eigen::AlignedBox3d& bounds_mm, const BrickFieldOptions& options);

  int count() const { return static_cast<int>(levels_.size()); }
  const Level& operator[](int level) const { return levels_[static_cast<size_t>(level)]; }
  const Level& finest() const { return levels_.front(); }
  bool IsTop(int level) const { return level + 1 == count(); }
  const Eigen::Vector3d& origin_mm() const { return origin_mm_; }
  /// Box that the top level covers.
  const Eigen::AlignedBox3d& domain_mm() const { return domain_mm_; }
  /// Address space of the index; pages that no look-up touches take no memory.
  size_t index_bytes() const;

  /// False if the point is outside of the level.
  inline bool PlaceOf(const Level& level, const Eigen::Vector3d& p, Place& place) const;
  Eigen::Vector3d CellCenter(const Level& level, const Eigen::Array3i& cell) const {
    // One formula for every use of a sample: neighbors share coefficients to the bit.
    return origin_mm_ + level.cell_mm * (cell.cast<double>() + 0.5).matrix();
  }

 private:
  struct FreeIndex {
    void operator()(Entry* index) const;
  };

  Eigen::AlignedBox3d domain_mm_;
  Eigen::Vector3d origin_mm_;
  std::vector<Level> levels_;
  std::vector<std::unique_ptr<Entry, FreeIndex>> indices_;
};

inline bool BrickLevels::PlaceOf(const Level& level, const Eigen::Vector3d& p, Place& place) const {
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

}  // namespace torquer::vessel
