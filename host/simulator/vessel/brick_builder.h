// Brick builder: builds the bricks of a field on demand, from any number of threads. It can also
// adopt the bricks of an earlier run.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stop_token>
#include <vector>

#include "host/simulator/vessel/brick_kernel.h"
#include "host/simulator/vessel/brick_levels.h"
#include "host/simulator/vessel/distance_source.h"

namespace torquer::vessel {

/// Brick in the form of a cache file.
struct StoredBrick {
  int32_t level;
  int32_t place[3];
  /// kernel::kCoefficients values; in a cache file, their Checksum follows.
  const float* coefficients;

  uint64_t Checksum() const;
};

/// All methods except Adopt are thread-safe. The time, thread and order of building do not matter.
/// A brick depends only on the distance and its place, so the first thread to publish it wins.
class BrickBuilder {
 public:
  using Entry = BrickLevels::Entry;

  /// levels: must outlive the builder, which writes to their index.
  BrickBuilder(std::shared_ptr<const DistanceSource> source, const BrickLevels& levels,
               size_t memory_limit_bytes)
      : source_(std::move(source)),
        levels_(levels),
        memory_limit_bytes_(memory_limit_bytes),
        complete_(static_cast<size_t>(levels.count())) {}
  BrickBuilder(const BrickBuilder&) = delete;
  BrickBuilder& operator=(const BrickBuilder&) = delete;
  ~BrickBuilder();

  /// Coefficients of a brick, which is built if necessary. Null if it is inactive or outside of its
  /// level. Throws UserError beyond the memory limit.
  const float* Ensure(int level, const Eigen::Array3i& brick) const;
  /// Resolves the entry of a brick within its level that is not usable yet. The result is usable or
  /// inactive.
  __attribute__((noinline)) Entry Resolve(int level, const Eigen::Array3i& brick) const;

  /// See BrickField.
  void Prefetch(const Eigen::Vector3d& point_mm, double radius_mm) const;
  bool Build(int finest_level, int threads, const std::stop_token& stop) const;
  bool Adopt(const std::vector<StoredBrick>& bricks, const std::vector<bool>& complete_levels,
             std::shared_ptr<const void> keep);

  /// All bricks that exist now.
  std::vector<StoredBrick> StoredBricks() const;
  /// True if all active bricks of a level exist; the others are then known to be inactive.
  bool IsComplete(int level) const { return complete_[static_cast<size_t>(level)].load(); }
  /// Bricks that this object built, without adopted ones.
  size_t built_count() const { return built_count_.load(); }
  size_t built_bytes() const { return built_count() * sizeof(Brick); }

 private:
  struct Brick {
    float coefficients[kernel::kCoefficients];
    int32_t level;
    int32_t place[3];
    Brick* next;
  };

  std::unique_ptr<Brick> Make(int level, const Eigen::Array3i& place) const;
  void Keep(std::unique_ptr<Brick> brick) const;
  std::vector<Eigen::Array3i> Candidates(int level, const std::vector<Eigen::Array3i>& above) const;

  const std::shared_ptr<const DistanceSource> source_;
  const BrickLevels& levels_;
  const size_t memory_limit_bytes_;
  mutable std::vector<std::atomic<bool>> complete_;  // by level
  std::shared_ptr<const void> adopted_memory_;
  std::vector<StoredBrick> adopted_;
  mutable std::atomic<Brick*> built_{nullptr};  // a list, newest first
  mutable std::atomic<size_t> built_count_{0};
};

}  // namespace torquer::vessel
