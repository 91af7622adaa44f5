// Brick field: a clearance field of quadratic B-spline bricks in nested levels, built on demand.
//
// brick_levels.h lays out the bricks, brick_fit.h fits them, brick_builder.h builds them, and
// brick_kernel.h evaluates the spline. This file has the look-ups for a wire.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <stop_token>
#include <utility>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/brick_builder.h"
#include "host/simulator/vessel/brick_kernel.h"
#include "host/simulator/vessel/brick_levels.h"
#include "host/simulator/vessel/distance_source.h"

namespace torquer::vessel {

/// Number of bricks in a field, and their memory.
struct BrickFieldStatistics {
  int levels = 0;
  std::vector<size_t> bricks;  ///< by level, finest first; those of a cache file included
  size_t bricks_built = 0;     ///< by this object, not taken from a cache
  size_t brick_bytes = 0;      ///< on the heap
  size_t index_bytes = 0;      ///< address space; untouched pages take no memory
};

class BrickField final : public ClearanceField {
 public:
  /// source: the distance; its zero level lies within bounds_mm. Throws UserError if options are
  /// out of range or the vessel is too large for them. A look-up throws UserError if its brick
  /// would exceed the memory limit.
  BrickField(std::shared_ptr<const DistanceSource> source, const Eigen::AlignedBox3d& bounds_mm,
             const BrickFieldOptions& options);

  /// Field of a function that is nowhere steeper than 1 and has its zero level within bounds_mm.
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

  // As above without a virtual call. The point must be finite.
  inline double Look(const Eigen::Vector3d& point_mm) const;
  inline void LookGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const;
  inline void LookHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const;

  /// Builds all bricks that look-ups within radius_mm of a point need. Safe concurrently with
  /// look-ups and with itself; meant for a thread that runs ahead of the wire.
  void Prefetch(const Eigen::Vector3d& point_mm, double radius_mm) const {
    builder_.Prefetch(point_mm, radius_mm);
  }

  /// Builds every brick from the coarsest level down to finest_level (0: all levels) on `threads`
  /// threads. Returns false if a stop was requested before the end.
  bool Build(int finest_level, int threads, const std::stop_token& stop = {}) const {
    return builder_.Build(finest_level, threads, stop);
  }

  const BrickFieldOptions& options() const { return options_; }
  const Eigen::AlignedBox3d& bounds_mm() const { return bounds_mm_; }
  int level_count() const { return levels_.count(); }
  BrickFieldStatistics Statistics() const;

  /// All bricks that exist now.
  std::vector<StoredBrick> StoredBricks() const { return builder_.StoredBricks(); }
  /// True if all active bricks of a level exist; the others are then known to be inactive.
  bool IsComplete(int level) const { return builder_.IsComplete(level); }
  /// Adopts bricks of an earlier run with the same source and options. They are not copied: `keep`
  /// keeps their memory alive. The first look-up of a brick checks its checksum, and rebuilds it on
  /// a mismatch. Call only before the first look-up. Returns false without effect if places or
  /// complete levels do not fit this field.
  bool Adopt(const std::vector<StoredBrick>& bricks, const std::vector<bool>& complete_levels,
             std::shared_ptr<const void> keep) {
    return builder_.Adopt(bricks, complete_levels, std::move(keep));
  }

 private:
  // Measured: 1.2 on real meshes, at the ridges of small vessels; an exact distance has 1.
  static constexpr double kLipschitzBound = 1.3;
  static constexpr double kFarMm = 20;  // the slope beyond the box tends to -1 over this length

  using Entry = BrickLevels::Entry;
  // Input of the spline: the first of 27 coefficients (null: outside of all levels) and the place
  // in the cell.
  struct Cell {
    const float* corner;
    double tx, ty, tz;
    double per_mm;
  };
  static inline Cell CellOf(const BrickLevels::Level& level, const BrickLevels::Place& place,
                            Entry entry);
  inline Cell Locate(const Eigen::Vector3d& p) const;
  __attribute__((noinline)) Cell LocateAnywhere(const Eigen::Vector3d& p) const;
  template <int kOrder>
  inline bool Evaluate(const Eigen::Vector3d& point_mm, kernel::Jet& jet, double& per_mm) const;
  void EvaluateBeyond(const Eigen::Vector3d& point_mm, ClearanceSample& out) const;

  const BrickFieldOptions options_;
  const Eigen::AlignedBox3d bounds_mm_;
  const BrickLevels levels_;
  BrickBuilder builder_;
};

inline BrickField::Cell BrickField::CellOf(const BrickLevels::Level& level,
                                           const BrickLevels::Place& place, Entry entry) {
  return {reinterpret_cast<const float*>(entry - 1) + (place.z & 7) * kernel::kPlane +
              (place.y & 7) * kernel::kRow + (place.x & 7),
          place.tx, place.ty, place.tz, level.cells_per_mm};
}

inline BrickField::Cell BrickField::Locate(const Eigen::Vector3d& p) const {
  // The finest level comes first because it serves the look-ups near the wall; the rest is out of
  // line.
  const BrickLevels::Level& finest = levels_.finest();
  BrickLevels::Place place;
  if (levels_.PlaceOf(finest, p, place)) [[likely]] {
    const Entry entry =
        std::atomic_ref<Entry>(finest.index[place.index]).load(std::memory_order_acquire);
    if (BrickLevels::IsUsable(entry)) [[likely]]
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
  // Beyond the box, differences are accurate enough.
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
