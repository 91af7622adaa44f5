#include "host/simulator/vessel/brick_field.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <limits>
#include <mutex>
#include <sstream>
#include <thread>
#include <utility>

#include "host/support/error.h"

namespace torquer::vessel {

using Eigen::Array3d;
using Eigen::Array3i;
using Eigen::Vector3d;
using kernel::kCells;
using kernel::kPlane;
using kernel::kRow;

namespace {

constexpr int kRatio = 4;                 // cell widths of neighboring levels
constexpr double kTopCellAtLeastMm = 10;  // coarser levels would save nothing
constexpr int kSamples = kRow + 2;        // along an axis: the fit looks at both neighbors
// The fit's correction is limited where the distance has a ridge: a full one would overshoot there,
// and makes the field steeper than a distance. In cell widths; a wall of radius two cells or more
// is not touched by it.
constexpr double kSecondDifferenceLimit = 0.5;

// Share of the three coarse coefficients about a cell in each of the four fine ones within it
// (Chaikin's subdivision, twice).
constexpr double kSubdivision[kRatio][3] = {{6.0 / 16, 10.0 / 16, 0},
                                            {3.0 / 16, 12.0 / 16, 1.0 / 16},
                                            {1.0 / 16, 12.0 / 16, 3.0 / 16},
                                            {0, 10.0 / 16, 6.0 / 16}};

// 1 up to full, 0 from edge on, with two continuous derivatives between.
double FineShare(double distance, double full, double edge) {
  const double x = std::clamp((distance - full) / (edge - full), 0.0, 1.0);
  return 1 - x * x * x * (10 + x * (6 * x - 15));
}

}  // namespace

void BrickField::FreeIndex::operator()(Entry* index) const { std::free(index); }

BrickField::BrickField(std::shared_ptr<const DistanceSource> source,
                       const Eigen::AlignedBox3d& bounds_mm, const BrickFieldOptions& options)
    : source_(std::move(source)), options_(options), bounds_mm_(bounds_mm) {
  std::ostringstream text;
  if (!(options.voxel_mm >= 0.02 && options.voxel_mm <= 4)) {
    text << "voxel_mm = " << options.voxel_mm << " is out of range; give 0.02 to 4";
  } else if (!(options.band_mm > 0 && options.band_mm <= 100)) {
    text << "band_mm = " << options.band_mm << " is out of range; give more than 0, at most 100";
  } else if (!(options.margin_mm >= 0 && options.margin_mm <= 1e4)) {
    text << "margin_mm = " << options.margin_mm << " is out of range; give 0 to 10000";
  } else if (bounds_mm.isEmpty() || !bounds_mm.min().allFinite() || !bounds_mm.max().allFinite()) {
    text << "the vessel has no extent";
  }
  if (!text.str().empty()) throw UserError(text.str());

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

  levels_ = std::vector<Level>(level_count);
  size_t index_bytes = 0;
  double cell = options.voxel_mm;
  for (int l = 0; l < level_count; ++l, cell *= kRatio) {
    Level& level = levels_[l];
    level.cell_mm = cell;
    level.cells_per_mm = 1 / cell;
    level.full_mm = std::max(options.band_mm, 3 * cell);
    level.edge_mm = level.full_mm + 4 * cell;
    const double brick_mm = kCells * cell;
    const bool is_top = l + 1 == level_count;
    // An active brick has a coefficient within the band, and those reach half a cell beyond it.
    const double reach = is_top ? options.margin_mm : level.edge_mm + cell;
    const Array3d low = (bounds_mm.min() - origin_mm_).array() - reach;
    const Array3d high = (bounds_mm.max() - origin_mm_).array() + reach;
    const Array3i all = (top_bricks.cast<double>() * (top_cell / cell)).round().cast<int>();
    level.first = (low / brick_mm).floor().cast<int>().max(0).min(all - 1);
    const Array3i last = (high / brick_mm).floor().cast<int>().max(0).min(all - 1);
    level.count = is_top ? all : Array3i(last - level.first + 1);
    if (is_top) level.first.setZero();
    level.stride_y = level.count.x();
    level.stride_z = static_cast<ptrdiff_t>(level.count.x()) * level.count.y();
    level.offset =
        level.first.z() * level.stride_z + level.first.y() * level.stride_y + level.first.x();
    level.low = (level.first * kCells).cast<double>();
    level.high = ((level.first + level.count) * kCells).cast<double>();
    const double entries = level.count.cast<double>().prod();
    index_bytes += static_cast<size_t>(std::min(entries, 1e15)) * sizeof(Entry);
    if (index_bytes > options.memory_limit_bytes) {
      text << "a vessel of " << bounds_mm.sizes().transpose()
           << " mm with voxel_mm = " << options.voxel_mm << " needs an index of over "
           << (options.memory_limit_bytes >> 20) << " MB; use a larger voxel_mm";
      throw UserError(text.str());
    }
  }
  for (Level& level : levels_) {
    // calloc, because pages that no look-up touches then never become memory.
    const size_t entries = static_cast<size_t>(level.count.x()) * level.count.y() * level.count.z();
    level.index = static_cast<Entry*>(std::calloc(entries, sizeof(Entry)));
    if (level.index == nullptr) throw std::bad_alloc();
    indices_.emplace_back(level.index);
  }
}

BrickField::~BrickField() {
  for (Brick* brick = built_.load(); brick != nullptr;) {
    Brick* next = brick->next;
    delete brick;
    brick = next;
  }
}

std::unique_ptr<BrickField> BrickField::FromFunction(
    std::function<double(const Vector3d&)> function, const Eigen::AlignedBox3d& bounds_mm,
    const BrickFieldOptions& options) {
  return std::make_unique<BrickField>(std::make_shared<FunctionSource>(std::move(function)),
                                      bounds_mm, options);
}

Vector3d BrickField::CellCenter(const Level& level, const Array3i& cell) const {
  // One formula for a sample wherever it is used: neighbors share coefficients to the bit.
  return origin_mm_ + level.cell_mm * (cell.cast<double>() + 0.5).matrix();
}

// Whether no coefficient of a brick lies within its level's band, seen from a few distances.
bool BrickField::IsFar(int l, const Array3i& brick) const {
  const Level& level = levels_[l];
  const Array3i cell = brick * kCells;
  const Vector3d center = 0.5 * (CellCenter(level, cell + 3) + CellCenter(level, cell + 4));
  const double half = 0.5 * (kRow - 1) * level.cell_mm;
  if (std::abs(source_->Distance(center)) >= level.edge_mm + half * std::sqrt(3.0)) return true;
  const double third = half / 3;
  for (int k = -1; k <= 1; ++k) {
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        const Vector3d at = center + 2 * third * Vector3d(i, j, k);
        if (std::abs(source_->Distance(at)) < level.edge_mm + third * std::sqrt(3.0)) return false;
      }
    }
  }
  return true;
}

bool BrickField::Fit(int l, const Array3i& brick, float* coefficients) const {
  const Level& level = levels_[l];
  const bool is_top = l + 1 == level_count();
  if (!is_top && IsFar(l, brick)) return false;

  const Array3i corner = brick * kCells - 2;
  double axis[3][kSamples];
  for (int i = 0; i < kSamples; ++i) {
    const Vector3d at = CellCenter(level, corner + i);
    for (int a = 0; a < 3; ++a) axis[a][i] = at[a];
  }
  double samples[kSamples * kSamples * kSamples];
  source_->SampleGrid(axis[0], axis[1], axis[2], kSamples, samples);

  constexpr int kStride[3] = {1, kSamples, kSamples * kSamples};
  const double limit = kSecondDifferenceLimit * level.cell_mm;
  double share[kRow * kRow * kRow];
  double least_share = 1, largest_share = is_top ? 1 : 0;
  int at = 0;
  for (int k = 1; k <= kRow; ++k) {
    for (int j = 1; j <= kRow; ++j) {
      for (int i = 1; i <= kRow; ++i, ++at) {
        const double* f = samples + (k * kSamples + j) * kSamples + i;
        double correction = 0;
        for (const int stride : kStride) {
          correction += std::clamp(f[-stride] - 2 * f[0] + f[stride], -limit, limit);
        }
        share[at] = is_top ? 1 : FineShare(std::abs(f[0]), level.full_mm, level.edge_mm);
        least_share = std::min(least_share, share[at]);
        largest_share = std::max(largest_share, share[at]);
        coefficients[at] = static_cast<float>(f[0] - correction / 8);
      }
    }
  }
  std::fill(coefficients + at, coefficients + kernel::kCoefficients, 0.0F);
  if (largest_share == 0) return false;
  if (least_share == 1) return true;

  const Array3i parent(brick.x() / kRatio, brick.y() / kRatio, brick.z() / kRatio);
  const float* coarse = Ensure(l + 1, parent);
  assert(coarse != nullptr);  // a band lies within the next coarser one's
  at = 0;
  for (int k = -1; k <= kCells; ++k) {
    for (int j = -1; j <= kCells; ++j) {
      for (int i = -1; i <= kCells; ++i, ++at) {
        if (share[at] == 1) continue;
        const Array3i fine = brick * kCells + Array3i(i, j, k);
        const Array3i cell(fine.x() >> 2, fine.y() >> 2, fine.z() >> 2);
        const Array3i local = cell - parent * kCells;  // -1 to kCells
        double sum = 0;
        for (int c = 0; c < 3; ++c) {
          const double wz = kSubdivision[fine.z() & 3][c];
          if (wz == 0) continue;
          for (int b = 0; b < 3; ++b) {
            const double wy = wz * kSubdivision[fine.y() & 3][b];
            if (wy == 0) continue;
            const float* row =
                coarse + (local.z() + c) * kPlane + (local.y() + b) * kRow + local.x();
            for (int a = 0; a < 3; ++a) {
              const double weight = kSubdivision[fine.x() & 3][a];
              if (weight != 0) sum += wy * weight * static_cast<double>(row[a]);
            }
          }
        }
        coefficients[at] = static_cast<float>(share[at] * static_cast<double>(coefficients[at]) +
                                              (1 - share[at]) * sum);
      }
    }
  }
  return true;
}

BrickField::Entry BrickField::Resolve(int l, const Array3i& brick) const {
  const Level& level = levels_[l];
  std::atomic_ref<Entry> slot(level.index[IndexOf(level, brick)]);
  Entry found = slot.load(std::memory_order_acquire);
  const auto publish = [&](Entry entry) {
    // Whoever comes first is right: all fit the same coefficients.
    return slot.compare_exchange_strong(found, entry, std::memory_order_acq_rel) ? entry : found;
  };
  if ((found & 1) != 0 || found == kInactive) return found;
  if (found != kUnknown) {
    const auto* stored = reinterpret_cast<const float*>(found - 2);
    uint64_t checksum = 0;
    std::memcpy(&checksum, stored + kernel::kCoefficients, sizeof checksum);
    if (Checksum({l, {brick.x(), brick.y(), brick.z()}, stored}) == checksum) {
      return publish(found - 1);
    }
  } else if (level.complete.load(std::memory_order_relaxed)) {
    return publish(kInactive);
  }
  auto made = std::make_unique<Brick>();
  if (!Fit(l, brick, made->coefficients)) return publish(kInactive);
  if ((built_count_.load(std::memory_order_relaxed) + 1) * sizeof(Brick) >
      options_.memory_limit_bytes) {
    throw UserError("the vessel's field needs more than " +
                    std::to_string(options_.memory_limit_bytes >> 20) +
                    " MB; use a larger voxel_mm or allow more memory");
  }
  made->level = l;
  for (int a = 0; a < 3; ++a) made->place[a] = brick[a];
  const Entry mine = reinterpret_cast<Entry>(made->coefficients) + 1;
  const Entry winner = publish(mine);
  if (winner == mine) {
    built_count_.fetch_add(1, std::memory_order_relaxed);
    Brick* list = built_.load(std::memory_order_relaxed);
    do {
      made->next = list;
    } while (!built_.compare_exchange_weak(list, made.get(), std::memory_order_release,
                                           std::memory_order_relaxed));
    static_cast<void>(made.release());
  }
  return winner;
}

BrickField::Cell BrickField::LocateAnywhere(const Vector3d& p) const {
  Place place;
  for (int l = 0; l < level_count(); ++l) {
    const Level& level = levels_[l];
    if (!PlaceOf(level, p, place)) continue;
    Entry entry = std::atomic_ref<Entry>(level.index[place.index]).load(std::memory_order_acquire);
    if ((entry & 1) == 0 && entry != kInactive) {
      entry = Resolve(l, {place.x >> 3, place.y >> 3, place.z >> 3});
    }
    if (entry != kInactive) return CellOf(level, place, entry);
  }
  return {nullptr, 0, 0, 0, 0};
}

const float* BrickField::Ensure(int l, const Array3i& brick) const {
  const Level& level = levels_[l];
  if (!InIndex(level, brick)) return nullptr;
  Entry entry =
      std::atomic_ref<Entry>(level.index[IndexOf(level, brick)]).load(std::memory_order_acquire);
  if ((entry & 1) == 0 && entry != kInactive) entry = Resolve(l, brick);
  return entry == kInactive ? nullptr : reinterpret_cast<const float*>(entry - 1);
}

void BrickField::Prefetch(const Vector3d& point_mm, double radius_mm) const {
  for (int l = level_count() - 1; l >= 0; --l) {
    const Level& level = levels_[l];
    const double brick_mm = kCells * level.cell_mm;
    const Array3d at = (point_mm - origin_mm_).array();
    const Array3i end = level.first + level.count - 1;
    const auto clip = [&](const Array3d& place) {
      const Array3d brick = (place / brick_mm).floor();
      return Array3i(brick.max(level.first.cast<double>()).min(end.cast<double>()).cast<int>());
    };
    const Array3i low = clip(at - radius_mm), high = clip(at + radius_mm);
    for (int k = low.z(); k <= high.z(); ++k) {
      for (int j = low.y(); j <= high.y(); ++j) {
        for (int i = low.x(); i <= high.x(); ++i) {
          const Array3d corner = brick_mm * Array3d(i, j, k);
          const Array3d nearest = at.max(corner).min(corner + brick_mm);
          if ((nearest - at).matrix().norm() <= radius_mm) Ensure(l, {i, j, k});
        }
      }
    }
  }
}

bool BrickField::Build(int finest_level, int threads, std::stop_token stop) const {
  std::vector<Array3i> active;  // of the level above
  for (int l = level_count() - 1; l >= std::max(0, finest_level); --l) {
    const Level& level = levels_[l];
    std::vector<Array3i> bricks;
    if (l + 1 == level_count()) {
      for (int k = 0; k < level.count.z(); ++k) {
        for (int j = 0; j < level.count.y(); ++j) {
          for (int i = 0; i < level.count.x(); ++i) bricks.emplace_back(i, j, k);
        }
      }
    } else {
      for (const Array3i& parent : active) {
        for (int child = 0; child < kRatio * kRatio * kRatio; ++child) {
          const Array3i brick = parent * kRatio + Array3i(child & 3, (child >> 2) & 3, child >> 4);
          if (InIndex(level, brick)) bricks.push_back(brick);
        }
      }
    }
    std::vector<char> is_active(bricks.size(), 0);
    std::atomic<size_t> next{0};
    std::exception_ptr failure;
    std::mutex failure_mutex;
    const auto work = [&] {
      try {
        for (size_t i; !stop.stop_requested() && (i = next.fetch_add(1)) < bricks.size();) {
          is_active[i] = Ensure(l, bricks[i]) != nullptr;
        }
      } catch (...) {
        const std::lock_guard<std::mutex> lock(failure_mutex);
        failure = std::current_exception();
      }
    };
    {
      std::vector<std::jthread> helpers;
      for (int t = 1; t < threads; ++t) helpers.emplace_back(work);
      work();
    }
    if (failure) std::rethrow_exception(failure);
    if (stop.stop_requested()) return false;
    levels_[l].complete.store(true);
    active.clear();
    for (size_t i = 0; i < bricks.size(); ++i) {
      if (is_active[i]) active.push_back(bricks[i]);
    }
  }
  return true;
}

// Beyond the box the spline goes on along its slope at the border, which over kFarMm turns into -1
// a millimeter. With c the nearest point of the box, e = p - c and t = |e|:
//   f(p) = f(c) + g(c) . e / (1 + t/L) - (t - t / (1 + t/L))
void BrickField::EvaluateBeyond(const Vector3d& point_mm, ClearanceSample& out) const {
  if (!point_mm.allFinite()) {
    out.clearance_mm = std::numeric_limits<double>::quiet_NaN();
    out.gradient.setConstant(out.clearance_mm);
    return;
  }
  const Vector3d inset = 1e-9 * domain_mm_.sizes();
  const Vector3d nearest =
      point_mm.cwiseMax(domain_mm_.min() + inset).cwiseMin(domain_mm_.max() - inset);
  kernel::Jet jet{};
  double per_mm = 0;
  const bool inside = Evaluate<2>(nearest, jet, per_mm);
  assert(inside);
  static_cast<void>(inside);
  const Vector3d g = per_mm * Vector3d(jet.d[0], jet.d[1], jet.d[2]);
  Eigen::Matrix3d mixed;
  mixed << 0, jet.dd[3], jet.dd[4], jet.dd[3], 0, jet.dd[5], jet.dd[4], jet.dd[5], 0;
  mixed *= per_mm * per_mm;
  const Vector3d e = point_mm - nearest;
  const double t = e.stableNorm();
  const double share = 1 / (1 + t / kFarMm);
  out.clearance_mm = jet.value + g.dot(e) * share - (t - t * share);
  const Vector3d sideways = mixed * e * share;
  for (int a = 0; a < 3; ++a) {
    if (e[a] == 0) {
      out.gradient[a] = g[a] + sideways[a];
    } else {
      out.gradient[a] =
          g[a] * share + e[a] / t * (-g.dot(e) * share * share / kFarMm - (1 - share * share));
    }
  }
}

BrickFieldStatistics BrickField::Statistics() const {
  BrickFieldStatistics statistics;
  statistics.levels = level_count();
  statistics.bricks.assign(levels_.size(), 0);
  for (const StoredBrick& brick : StoredBricks()) ++statistics.bricks[brick.level];
  statistics.bricks_built = built_count_.load();
  statistics.brick_bytes = statistics.bricks_built * sizeof(Brick);
  for (const Level& level : levels_) {
    statistics.index_bytes += level.count.cast<size_t>().prod() * sizeof(Entry);
  }
  return statistics;
}

std::vector<BrickField::StoredBrick> BrickField::StoredBricks() const {
  std::vector<StoredBrick> bricks;
  for (const StoredBrick& brick : adopted_) {
    // One that fails its check has been built anew and stands in the list below.
    const Array3i place(brick.place[0], brick.place[1], brick.place[2]);
    if (Ensure(brick.level, place) == brick.coefficients) bricks.push_back(brick);
  }
  for (const Brick* brick = built_.load(std::memory_order_acquire); brick != nullptr;
       brick = brick->next) {
    bricks.push_back(
        {brick->level, {brick->place[0], brick->place[1], brick->place[2]}, brick->coefficients});
  }
  return bricks;
}

void BrickField::Adopt(const std::vector<StoredBrick>& bricks,
                       const std::vector<bool>& complete_levels, std::shared_ptr<const void> keep) {
  assert(built_count_.load() == 0 && adopted_.empty());
  adopted_memory_ = std::move(keep);
  for (const StoredBrick& brick : bricks) {
    const Array3i place(brick.place[0], brick.place[1], brick.place[2]);
    if (brick.level < 0 || brick.level >= level_count()) continue;
    const Level& level = levels_[brick.level];
    if (!InIndex(level, place)) continue;
    level.index[IndexOf(level, place)] = reinterpret_cast<Entry>(brick.coefficients) + 2;
    adopted_.push_back(brick);
  }
  for (size_t l = 0; l < levels_.size() && l < complete_levels.size(); ++l) {
    levels_[l].complete.store(complete_levels[l]);
  }
}

uint64_t BrickField::Checksum(const StoredBrick& brick) {
  uint64_t hash = 0x243f6a8885a308d3;
  const auto mix = [&](uint64_t word) {
    hash = (hash ^ word) * 0x9e3779b97f4a7c15;
    hash ^= hash >> 29;
  };
  for (const int32_t number : {brick.level, brick.place[0], brick.place[1], brick.place[2]}) {
    mix(static_cast<uint32_t>(number));
  }
  static_assert(kernel::kCoefficients % 2 == 0);
  for (int i = 0; i < kernel::kCoefficients; i += 2) {
    uint64_t word = 0;
    std::memcpy(&word, brick.coefficients + i, sizeof word);
    mix(word);
  }
  return hash;
}

}  // namespace torquer::vessel
