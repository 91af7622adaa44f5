#include "host/simulator/vessel/brick_field.h"

#include <cassert>
#include <limits>

namespace torquer::vessel {

using Eigen::Vector3d;

BrickField::BrickField(std::shared_ptr<const DistanceSource> source,
                       const Eigen::AlignedBox3d& bounds_mm, const BrickFieldOptions& options)
    : options_(options),
      bounds_mm_(bounds_mm),
      levels_(bounds_mm, options),
      builder_(std::move(source), levels_, options.memory_limit_bytes) {}

std::unique_ptr<BrickField> BrickField::FromFunction(
    std::function<double(const Vector3d&)> function, const Eigen::AlignedBox3d& bounds_mm,
    const BrickFieldOptions& options) {
  return std::make_unique<BrickField>(std::make_shared<FunctionSource>(std::move(function)),
                                      bounds_mm, options);
}

BrickField::Cell BrickField::LocateAnywhere(const Vector3d& p) const {
  BrickLevels::Place place;
  for (int l = 0; l < levels_.count(); ++l) {
    const BrickLevels::Level& level = levels_[l];
    if (!levels_.PlaceOf(level, p, place)) continue;
    Entry entry = std::atomic_ref<Entry>(level.index[place.index]).load(std::memory_order_acquire);
    if (!BrickLevels::IsUsable(entry) && entry != BrickLevels::kInactive) {
      entry = builder_.Resolve(l, {place.x >> 3, place.y >> 3, place.z >> 3});
    }
    if (entry != BrickLevels::kInactive) return CellOf(level, place, entry);
  }
  return {nullptr, 0, 0, 0, 0};
}

// Continues the spline beyond the box along its slope at the border. Over L = kFarMm the slope
// tends to -1 per millimeter. With c the nearest point of the box, e = p - c and t = |e|:
//   f(p) = f(c) + g(c) . e / (1 + t/L) - (t - t / (1 + t/L))
void BrickField::EvaluateBeyond(const Vector3d& point_mm, ClearanceSample& out) const {
  if (!point_mm.allFinite()) {
    out.clearance_mm = std::numeric_limits<double>::quiet_NaN();
    out.gradient.setConstant(out.clearance_mm);
    return;
  }
  const Eigen::AlignedBox3d& domain_mm = levels_.domain_mm();
  const Vector3d inset = 1e-9 * domain_mm.sizes();
  const Vector3d nearest =
      point_mm.cwiseMax(domain_mm.min() + inset).cwiseMin(domain_mm.max() - inset);
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
  statistics.levels = levels_.count();
  statistics.bricks.assign(static_cast<size_t>(levels_.count()), 0);
  for (const StoredBrick& brick : builder_.StoredBricks()) {
    ++statistics.bricks[static_cast<size_t>(brick.level)];
  }
  statistics.bricks_built = builder_.built_count();
  statistics.brick_bytes = builder_.built_bytes();
  statistics.index_bytes = levels_.index_bytes();
  return statistics;
}

}  // namespace torquer::vessel
