// Parts of the vessel that move to and fro: what heartbeat and breathing share.
#pragma once

#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/region_spec.h"
#include "host/simulator/vessel/region.h"

namespace torquer::effects {

/// A displacement that repeats, offset(x, t) = way pulse(t / period + phase) weight(x), with the
/// weight of a union of regions.
class PeriodicMotion : public Effect, public vessel::FieldMotion {
 public:
  struct Settings {
    Eigen::Vector3d way_mm = Eigen::Vector3d::Zero();  ///< where the regions go
    double period_s = 1;
    double phase = 0;  ///< part of a period at t = 0, in [0, 1)
    std::vector<vessel::Region> regions;
  };
  explicit PeriodicMotion(Settings settings);

  vessel::FieldMotion* motion() override { return this; }
  void CopyFrom(const Effect& twin) override {
    const auto& from = dynamic_cast<const PeriodicMotion&>(twin);
    displaced_ = from.displaced_;
    travel_mm_ = from.travel_mm_;
  }

  void SetTime(double time_s) override;
  void AddOffset(const Eigen::Vector3d& point_mm, vessel::Offset& offset) const override;
  double TravelMm() const override { return travel_mm_; }
  double LargestStretch() const override;

  const Settings& settings() const { return settings_; }
  /// How far along its way the motion is at a part of its period, [0, 1): 0 to 1.
  double PulseAt(double part) const { return Pulse(part); }
  /// Share of the way that goes at a point of the moved vessel, 0 to 1.
  double WeightAt(const Eigen::Vector3d& point_mm) const;

 protected:
  /// The pulse, 0 .. 1 with two continuous derivatives, at a part of its period, [0, 1).
  virtual double Pulse(double part) const = 0;

 private:
  bool Weigh(const Eigen::Vector3d& point_mm, vessel::RegionWeight& all) const;

  const Settings settings_;
  double displaced_ = 0;  ///< the pulse now
  double travel_mm_ = 0;
};

/// Motions that together stretch more than this would nearly fold the vessel.
inline constexpr double kMostStretch = 0.8;

/// What all periodic motions have in common.
struct MotionSpec : TableSpec {
  double amplitude_mm = 0;
  DirectionSpec direction;
  double phase = 0;
  std::vector<RegionSpec> regions;
};

const Keys<MotionSpec>& MotionKeys();

/// Throws UserError where the vessel would fold, alone or with the motions made before.
PeriodicMotion::Settings MakeMotion(const MotionSpec& spec, const EffectContext& context,
                                    double period_s);

}  // namespace torquer::effects
