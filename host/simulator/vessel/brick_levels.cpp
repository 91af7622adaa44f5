#include "host/simulator/vessel/brick_levels.h"

#include <algorithm>
#include <cstdlib>
#include <new>
#include <sstream>

#include "host/support/error.h"

namespace torquer::vessel {

using Eigen::Array3d;
using Eigen::Array3i;
using Eigen::Vector3d;
using kernel::kCells;

namespace {

constexpr double kTopCellAtLeastMm = 10;  // coarser levels would not save memory

void Check(const Eigen::AlignedBox3d& bounds_mm, const BrickFieldOptions& options) {
  std::ostringstream text;
  if (!(options.voxel_mm >= 0.02 && options.voxel_mm <= 4)) {
    text << "voxel_mm = " << options.voxel_mm << " is out of range; give 0.02 to 4";
  } else if (!(options.band_mm > 0 && options.band_mm <= 100)) {
    text << "band_mm = " << options.band_mm << " is out of range; give more than 0, at most 100";
  } else if (!(options.margin_mm >= 0 && options.margin_mm <= 1e4)) {
    text << "margin_mm = " << options.margin_mm << " is out of range; give 0 to 10000";
  } else if (bounds_mm.isEmpty() || !bounds_mm.min().allFinite() || !bounds_mm.max().allFinite()) {
    text << "the vessel's bounding box is empty or not finite; check the coordinates of the vessel";
  }
  if (!text.str().empty()) throw UserError(text.str());
}

// Lays out the cells and bricks of a level. all_bricks: number that covers the whole domain.
BrickLevels::Level LayOut(const Eigen::AlignedBox3d& box_mm, const BrickFieldOptions& options,
                          double cell_mm, const Array3i& all_bricks, bool is_top) {
  BrickLevels::Level level;
  level.cell_mm = cell_mm;
  level.cells_per_mm = 1 / cell_mm;
  level.full_mm = std::max(options.band_mm, 3 * cell_mm);
  level.edge_mm = level.full_mm + 4 * cell_mm;
  const double brick_mm = kCells * cell_mm;
  // An active brick has a coefficient within the band; they reach half a cell beyond the brick.
  const double reach = is_top ? options.margin_mm : level.edge_mm + cell_mm;
  const Array3d low = box_mm.min().array() - reach;
  const Array3d high = box_mm.max().array() + reach;
  level.first = (low / brick_mm).floor().cast<int>().max(0).min(all_bricks - 1);
  const Array3i last = (high / brick_mm).floor().cast<int>().max(0).min(all_bricks - 1);
  level.count = is_top ? all_bricks : Array3i(last - level.first + 1);
  if (is_top) level.first.setZero();
  level.stride_y = level.count.x();
  level.stride_z = static_cast<ptrdiff_t>(level.count.x()) * level.count.y();
  level.offset =
      level.first.z() * level.stride_z + level.first.y() * level.stride_y + level.first.x();
  level.low = (level.first * kCells).cast<double>();
  level.high = ((level.first + level.count) * kCells).cast<double>();
  return level;
}

}  // namespace

void BrickLevels::FreeIndex::operator()(Entry* index) const { std::free(index); }

BrickLevels::BrickLevels(const Eigen::AlignedBox3d& bounds_mm, const BrickFieldOptions& options) {
  Check(bounds_mm, options);
  int level_count = 1;
  double top_cell = options.voxel_mm;
  while (top_cell < kTopCellAtLeastMm) {
    top_cell *= kRatio;
    ++level_count;
  }
  origin_mm_ = bounds_mm.min() - Vector3d::Constant(options.margin_mm);
  const Array3d extent = bounds_mm.sizes().array() + 2 * options.margin_mm;
  const Array3i top_bricks = (extent / (kCells * top_cell)).ceil().cast<int>().max(1);
  domain_mm_ = Eigen::AlignedBox3d(
      origin_mm_, origin_mm_ + Vector3d(top_bricks.cast<double>() * (kCells * top_cell)));

  const Eigen::AlignedBox3d from_origin_mm(bounds_mm.min() - origin_mm_,
                                           bounds_mm.max() - origin_mm_);
  double index_bytes = 0;
  double cell = options.voxel_mm;
  for (int l = 0; l < level_count; ++l, cell *= kRatio) {
    const Array3i all = (top_bricks.cast<double>() * (top_cell / cell)).round().cast<int>();
    levels_.push_back(LayOut(from_origin_mm, options, cell, all, l + 1 == level_count));
    index_bytes += levels_.back().count.cast<double>().prod() * sizeof(Entry);
    if (index_bytes > static_cast<double>(options.memory_limit_bytes)) {
      std::ostringstream text;
      text << "a vessel of " << bounds_mm.sizes().transpose()
           << " mm with voxel_mm = " << options.voxel_mm << " needs an index of over "
           << (options.memory_limit_bytes >> 20) << " MB; use a larger voxel_mm";
      throw UserError(text.str());
    }
  }
  for (Level& level : levels_) {
    // calloc, because then pages that no look-up touches take no memory.
    level.index =
        static_cast<Entry*>(std::calloc(level.count.cast<size_t>().prod(), sizeof(Entry)));
    if (level.index == nullptr) throw std::bad_alloc();
    indices_.emplace_back(level.index);
  }
}

size_t BrickLevels::index_bytes() const {
  size_t bytes = 0;
  for (const Level& level : levels_) bytes += level.count.cast<size_t>().prod() * sizeof(Entry);
  return bytes;
}

}  // namespace torquer::vessel
