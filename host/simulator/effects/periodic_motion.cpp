#include "host/simulator/effects/periodic_motion.h"

#include <cmath>
#include <cstdio>

#include "host/simulator/effects/region_keys.h"

namespace torquer::effects {

using Eigen::Vector3d;
using vessel::RegionWeight;

PeriodicMotion::PeriodicMotion(Settings settings) : settings_(std::move(settings)) {}

void PeriodicMotion::SetTime(double time_s) {
  const double periods = time_s / settings_.period_s + settings_.phase;
  const double now = Pulse(periods - std::floor(periods));
  // Only times that are set are ever looked at: the way between two of them counts straight.
  travel_mm_ += settings_.way_mm.norm() * std::abs(now - displaced_);
  displaced_ = now;
}

void PeriodicMotion::AddOffset(const Vector3d& point_mm, vessel::Offset& offset) const {
  if (displaced_ == 0) return;
  // 1 - weight of the union is the product of what the regions leave.
  RegionWeight all;
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
  if (!any) return;
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

namespace {

constexpr Key kAmplitude = {"amplitude_mm",          "mm", 0.001, 200, std::nullopt,
                            "how far the regions go"};
constexpr Key kPhase = {"phase", "", 0, 1, 0, "part of a period at which the session starts"};

}  // namespace

PeriodicMotion::Settings ReadMotion(StrictTable& keys, const EffectContext& context,
                                    double period_s) {
  PeriodicMotion::Settings settings;
  const double amplitude_mm = kAmplitude.Read(keys);
  settings.way_mm = amplitude_mm * ReadPatientDirection(keys, "direction", context);
  settings.period_s = period_s;
  settings.phase = kPhase.Read(keys);
  for (StrictTable* region : keys.Tables("region")) {
    settings.regions.push_back(ReadRegion(*region, context));
  }
  if (settings.regions.empty()) {
    keys.Refuse("region", "is missing; add a table with the part of the vessel that moves");
  }
  double slope = 0;
  for (const vessel::Region& region : settings.regions) slope += region.SteepestSlope();
  double others = 0;
  if (context.earlier != nullptr) {
    for (const std::unique_ptr<Effect>& effect : *context.earlier) {
      if (const vessel::FieldMotion* motion = effect->motion()) others += motion->LargestStretch();
    }
  }
  const double room = std::max(0.0, kMostStretch - others);
  if (amplitude_mm * slope > room) {
    char remedy[160];
    std::snprintf(remedy, sizeof remedy,
                  "would fold the vessel over at the regions' edges%s; give at most %.3g mm, or "
                  "edges %.3g times as wide",
                  others > 0 ? ", with the other motions of this scene" : "", room / slope,
                  amplitude_mm * slope / std::max(room, 1e-3));
    keys.Refuse("amplitude_mm", remedy);
  }
  return settings;
}

std::vector<Key> MotionKeys(const std::vector<Key>& more) {
  std::vector<Key> keys = {kAmplitude, kPhase};
  keys.insert(keys.begin(), more.begin(), more.end());
  return keys;
}

std::vector<OtherKey> OtherMotionKeys() {
  std::vector<OtherKey> keys = {
      {"direction", "[x, y, z] or left, right, anterior, posterior, superior, inferior",
       "where the regions go"}};
  const std::vector<OtherKey> regions = RegionKeys({});
  keys.insert(keys.end(), regions.begin(), regions.end());
  return keys;
}

}  // namespace torquer::effects
