#include "host/simulator/vessel/brick_builder.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <exception>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "host/simulator/vessel/brick_fit.h"
#include "host/support/error.h"

namespace torquer::vessel {

using Eigen::Array3d;
using Eigen::Array3i;
using Eigen::Vector3d;
using kernel::kCells;

namespace {

// Calls work(i) for every i below count on several threads; a requested stop prevents further
// calls. Rethrows an exception of `work` after all threads have ended.
template <typename Work>
void ForEachInThreads(size_t count, int threads, const std::stop_token& stop, Work work) {
  std::atomic<size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto run = [&] {
    try {
      for (size_t i; !stop.stop_requested() && (i = next.fetch_add(1)) < count;) work(i);
    } catch (...) {
      const std::lock_guard<std::mutex> lock(failure_mutex);
      failure = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> helpers;
    for (int t = 1; t < threads; ++t) helpers.emplace_back(run);
    run();
  }
  if (failure) std::rethrow_exception(failure);
}

// Checks that every brick has a place in its level. All levels above a complete level must be
// complete, and a complete top level must have all its bricks.
bool CanBeAdopted(const BrickLevels& levels, const std::vector<StoredBrick>& bricks,
                  const std::vector<bool>& complete_levels) {
  std::set<std::array<std::int32_t, 3>> at_top;
  for (const StoredBrick& brick : bricks) {
    if (brick.level < 0 || brick.level >= levels.count()) return false;
    const Array3i place(brick.place[0], brick.place[1], brick.place[2]);
    if (!levels[brick.level].Contains(place)) return false;
    if (levels.IsTop(brick.level)) at_top.insert({place.x(), place.y(), place.z()});
  }
  const auto complete = [&](int l) {
    return static_cast<size_t>(l) < complete_levels.size() &&
           complete_levels[static_cast<size_t>(l)];
  };
  for (size_t l = static_cast<size_t>(levels.count()); l < complete_levels.size(); ++l) {
    if (complete_levels[l]) return false;
  }
  for (int l = 0; l < levels.count(); ++l) {
    if (!complete(l)) continue;
    if (!levels.IsTop(l) && !complete(l + 1)) return false;
    const Array3i count = levels[l].count;
    const std::int64_t all = std::int64_t{count.x()} * count.y() * count.z();
    if (levels.IsTop(l) && std::ssize(at_top) != all) return false;
  }
  return true;
}

}  // namespace

BrickBuilder::~BrickBuilder() {
  for (Brick* brick = built_.load(); brick != nullptr;) {
    Brick* next = brick->next;
    delete brick;
    brick = next;
  }
}

const float* BrickBuilder::Ensure(int l, const Array3i& brick) const {
  const BrickLevels::Level& level = levels_[l];
  if (!level.Contains(brick)) return nullptr;
  Entry entry =
      std::atomic_ref<Entry>(level.index[level.IndexOf(brick)]).load(std::memory_order_acquire);
  if (!BrickLevels::IsUsable(entry) && entry != BrickLevels::kInactive) entry = Resolve(l, brick);
  return entry == BrickLevels::kInactive ? nullptr : reinterpret_cast<const float*>(entry - 1);
}

BrickBuilder::Entry BrickBuilder::Resolve(int l, const Array3i& brick) const {
  const BrickLevels::Level& level = levels_[l];
  std::atomic_ref<Entry> slot(level.index[level.IndexOf(brick)]);
  Entry found = slot.load(std::memory_order_acquire);
  const auto publish = [&](Entry entry) {
    // The first entry stays: all threads fit the same coefficients.
    return slot.compare_exchange_strong(found, entry, std::memory_order_acq_rel) ? entry : found;
  };
  if (BrickLevels::IsUsable(found) || found == BrickLevels::kInactive) return found;
  if (found != BrickLevels::kUnknown) {
    const auto* stored = reinterpret_cast<const float*>(found - 2);
    uint64_t checksum = 0;
    std::memcpy(&checksum, stored + kernel::kCoefficients, sizeof checksum);
    const StoredBrick taken_over{l, {brick.x(), brick.y(), brick.z()}, stored};
    if (taken_over.Checksum() == checksum) return publish(found - 1);
  } else if (complete_[static_cast<size_t>(l)].load(std::memory_order_relaxed)) {
    return publish(BrickLevels::kInactive);
  }
  std::unique_ptr<Brick> made = Make(l, brick);
  if (made == nullptr) return publish(BrickLevels::kInactive);
  const Entry mine = reinterpret_cast<Entry>(made->coefficients) + 1;
  const Entry winner = publish(mine);
  if (winner == mine) Keep(std::move(made));
  return winner;
}

// Null if the brick is inactive.
std::unique_ptr<BrickBuilder::Brick> BrickBuilder::Make(int l, const Array3i& place) const {
  auto made = std::make_unique<Brick>();
  BrickFit fit(*source_, levels_, l, place, made->coefficients);
  if (!fit.is_active()) return nullptr;
  if (fit.needs_coarse()) {
    const float* coarse = Ensure(l + 1, fit.coarse_brick());
    // A band lies within the next coarser level's band, so the brick must exist. A cached field
    // without it has wrongly marked that level as complete; the mark is removed.
    if (coarse == nullptr) {
      const BrickLevels::Level& above = levels_[l + 1];
      if (!above.Contains(fit.coarse_brick())) return nullptr;
      complete_[static_cast<size_t>(l + 1)].store(false);
      Entry inactive = BrickLevels::kInactive;
      std::atomic_ref<Entry>(above.index[above.IndexOf(fit.coarse_brick())])
          .compare_exchange_strong(inactive, BrickLevels::kUnknown, std::memory_order_acq_rel);
      coarse = Ensure(l + 1, fit.coarse_brick());
      if (coarse == nullptr) return nullptr;
    }
    fit.Blend(coarse);
  }
  if ((built_count_.load(std::memory_order_relaxed) + 1) * sizeof(Brick) > memory_limit_bytes_) {
    throw UserError("the vessel's field needs more than " +
                    std::to_string(memory_limit_bytes_ >> 20) + " MB; use a larger voxel_mm");
  }
  made->level = l;
  for (int a = 0; a < 3; ++a) made->place[a] = place[a];
  return made;
}

void BrickBuilder::Keep(std::unique_ptr<Brick> brick) const {
  built_count_.fetch_add(1, std::memory_order_relaxed);
  Brick* list = built_.load(std::memory_order_relaxed);
  do {
    brick->next = list;
  } while (!built_.compare_exchange_weak(list, brick.get(), std::memory_order_release,
                                         std::memory_order_relaxed));
  static_cast<void>(brick.release());
}

void BrickBuilder::Prefetch(const Vector3d& point_mm, double radius_mm) const {
  for (int l = levels_.count() - 1; l >= 0; --l) {
    const BrickLevels::Level& level = levels_[l];
    const double brick_mm = kCells * level.cell_mm;
    const Array3d at = (point_mm - levels_.origin_mm()).array();
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

// Bricks of a level that may be active: those within the active bricks of the level above.
std::vector<Array3i> BrickBuilder::Candidates(int l, const std::vector<Array3i>& above) const {
  const BrickLevels::Level& level = levels_[l];
  constexpr int kRatio = BrickLevels::kRatio;
  std::vector<Array3i> bricks;
  if (levels_.IsTop(l)) {
    for (int k = 0; k < level.count.z(); ++k) {
      for (int j = 0; j < level.count.y(); ++j) {
        for (int i = 0; i < level.count.x(); ++i) bricks.emplace_back(i, j, k);
      }
    }
    return bricks;
  }
  for (const Array3i& parent : above) {
    for (int child = 0; child < kRatio * kRatio * kRatio; ++child) {
      const Array3i brick = parent * kRatio + Array3i(child & 3, (child >> 2) & 3, child >> 4);
      if (level.Contains(brick)) bricks.push_back(brick);
    }
  }
  return bricks;
}

bool BrickBuilder::Build(int finest_level, int threads, const std::stop_token& stop) const {
  std::vector<Array3i> active;  // of the level above
  for (int l = levels_.count() - 1; l >= std::max(0, finest_level); --l) {
    const std::vector<Array3i> bricks = Candidates(l, active);
    std::vector<char> is_active(bricks.size(), 0);
    ForEachInThreads(bricks.size(), threads, stop,
                     [&](size_t i) { is_active[i] = Ensure(l, bricks[i]) != nullptr; });
    if (stop.stop_requested()) return false;
    complete_[static_cast<size_t>(l)].store(true);
    active.clear();
    for (size_t i = 0; i < bricks.size(); ++i) {
      if (is_active[i] != 0) active.push_back(bricks[i]);
    }
  }
  return true;
}

std::vector<StoredBrick> BrickBuilder::StoredBricks() const {
  std::vector<StoredBrick> bricks;
  for (const StoredBrick& brick : adopted_) {
    // A brick that failed its check was built again and is in the list below.
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

bool BrickBuilder::Adopt(const std::vector<StoredBrick>& bricks,
                         const std::vector<bool>& complete_levels,
                         std::shared_ptr<const void> keep) {
  assert(built_count_.load() == 0 && adopted_.empty());
  if (!CanBeAdopted(levels_, bricks, complete_levels)) return false;
  adopted_memory_ = std::move(keep);
  for (const StoredBrick& brick : bricks) {
    const Array3i place(brick.place[0], brick.place[1], brick.place[2]);
    const BrickLevels::Level& level = levels_[brick.level];
    level.index[level.IndexOf(place)] = reinterpret_cast<Entry>(brick.coefficients) + 2;
    adopted_.push_back(brick);
  }
  for (size_t l = 0; l < complete_.size() && l < complete_levels.size(); ++l) {
    complete_[l].store(complete_levels[l]);
  }
  return true;
}

uint64_t StoredBrick::Checksum() const {
  uint64_t hash = 0x243f6a8885a308d3;
  const auto mix = [&](uint64_t word) {
    hash = (hash ^ word) * 0x9e3779b97f4a7c15;
    hash ^= hash >> 29;
  };
  for (const int32_t number : {level, place[0], place[1], place[2]}) {
    mix(static_cast<uint32_t>(number));
  }
  static_assert(kernel::kCoefficients % 2 == 0);
  for (int i = 0; i < kernel::kCoefficients; i += 2) {
    uint64_t word = 0;
    std::memcpy(&word, coefficients + i, sizeof word);
    mix(word);
  }
  return hash;
}

}  // namespace torquer::vessel
