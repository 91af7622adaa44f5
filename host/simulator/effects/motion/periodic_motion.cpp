#include "host/simulator/effects/motion/periodic_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace torquer::effects {

using Eigen::Vector3d;
using vessel::RegionWeight;

PeriodicMotion::PeriodicMotion(Settings settings) : settings_(std::move(settings)) {}

void PeriodicMotion::SetTime(double time_s) {
  const double periods = time_s / settings_.period_s + settings_.phase;
  const double now = Pulse(periods - std::floor(periods));
  // The vessel is evaluated only at times set here, so the straight distance between them counts.
  last_travel_mm_ = settings_.way_mm.norm() * std::abs(now - displaced_);
  travel_mm_ += last_travel_mm_;
  displaced_ = now;
}

// Weight of the union of all regions; returns false if no region is near.
bool PeriodicMotion::Weigh(const Vector3d& point_mm, RegionWeight& all) const {
  // 1 - weight of the union is the product of 1 - weight over the regions.
  bool any = false;
  for (const vessel::Region& region : settings_.regions) {
    RegionWeight one;
    if (!region.Evaluate(point_mm, one)) continue;
    if (!any) {
      all = one;
      any = true;
      continue;
    }
    const double rest = 1 - one.value;
    all.hessian = rest * all.hessian + (1 - all.value) * one.hessian -
                  all.gradient * one.gradient.transpose() - one.gradient * all.gradient.transpose();
    all.gradient = rest * all.gradient + (1 - all.value) * one.gradient;
    all.value = 1 - rest * (1 - all.value);
  }
  return any;
}

double PeriodicMotion::WeightAt(const Vector3d& point_mm) const {
  RegionWeight all;
  return Weigh(point_mm, all) ? all.value : 0;
}

void PeriodicMotion::AddOffset(const Vector3d& point_mm, vessel::Offset& offset) const {
  if (displaced_ == 0) return;
  RegionWeight all;
  if (!Weigh(point_mm, all)) return;
  const Vector3d way = displaced_ * settings_.way_mm;
  offset.value += all.value * way;
  if (all.value == 1) return;
  offset.rigid = false;
  offset.jacobian += way * all.gradient.transpose();
  for (int k = 0; k < 3; ++k) offset.second[k] += way[k] * all.hessian;
}

double PeriodicMotion::LargestStretch() const {
  double slope = 0;
  for (const vessel::Region& region : settings_.regions) slope += region.SteepestSlope();
  return settings_.way_mm.norm() * slope;
}

const Keys<MotionSpec>& MotionKeys() {
  static const Keys<MotionSpec> keys =
      Keys<MotionSpec>()
          .Required()
          .Number("amplitude_mm", &MotionSpec::amplitude_mm, 0.001, 200, "mm",
                  "amplitude of the motion: largest displacement of the regions")
          .Required()
          .Direction("direction", &MotionSpec::direction,
                     "direction in which the regions move from rest")
          .Number("phase", &MotionSpec::phase, 0, 1, "",
                  "phase of the motion at the start of the session, as a fraction of the period")
          .Tables("region", &MotionSpec::regions, RegionKeys(), 1,
                  "regions of the vessel that move");
  return keys;
}

PeriodicMotion::Settings MakeMotion(const MotionSpec& spec, const EffectContext& context,
                                    double period_s) {
  PeriodicMotion::Settings settings;
  settings.way_mm = spec.amplitude_mm * context.Direction(spec.direction);
  settings.period_s = period_s;
  settings.phase = spec.phase;
  double slope = 0;
  for (const RegionSpec& region : spec.regions) {
    settings.regions.push_back(MakeRegion(region, context));
    slope += settings.regions.back().SteepestSlope();
  }
  double others = 0;
  if (context.earlier != nullptr) {
    for (const std::unique_ptr<Effect>& effect : *context.earlier) {
      if (const vessel::FieldMotion* motion = effect->motion()) others += motion->LargestStretch();
    }
  }
  const double room = std::max(0.0, kMostStretch - others);
  if (spec.amplitude_mm * slope > room) {
    spec.origin.Refuse(
        "amplitude_mm",
        fmt::format(
            "would fold the vessel over at the edges of the regions{}; give at most {:.3g} mm, "
            "or make each edge_mm {:.3g} times as large",
            others > 0 ? ", with the other motions of this scene" : "", room / slope,
            spec.amplitude_mm * slope / std::max(room, 1e-3)));
  }
  return settings;
}

}  // namespace torquer::effects
