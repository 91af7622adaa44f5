// Periodic motion of parts of the vessel: the common base of heartbeat and breathing.
#pragma once

#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/region_spec.h"
#include "host/simulator/vessel/region.h"

namespace torquer::effects {

/// Periodic displacement, offset(x, t) = way pulse(t / period + phase) weight(x), with the weight
/// of a union of regions.
class PeriodicMotion : public Effect, public vessel::FieldMotion {
 public:
  struct Settings {
    Eigen::Vector3d way_mm = Eigen::Vector3d::Zero();  ///< displacement of the regions at pulse 1
    double period_s = 1;
    double phase = 0;  ///< fraction of a period at t = 0, in [0, 1)
    std::vector<vessel::Region> regions;
  };
  explicit PeriodicMotion(Settings settings);

  vessel::FieldMotion* motion() override { return this; }
  void CopyFrom(const Effect& twin) override {
    const auto& from = dynamic_cast<const PeriodicMotion&>(twin);
    displaced_ = from.displaced_;
    travel_mm_ = from.travel_mm_;
    last_travel_mm_ = from.last_travel_mm_;
  }

  void SetTime(double time_s) override;
  void AddOffset(const Eigen::Vector3d& point_mm, vessel::Offset& offset) const override;
  double TravelMm() const override { return travel_mm_; }
  double LastTravelMm() const override { return last_travel_mm_; }
  double LargestStretch() const override;

  const Settings& settings() const { return settings_; }
  /// Pulse, 0 to 1, at a fraction of the period, [0, 1).
  double PulseAt(double fraction) const { return Pulse(fraction); }
  /// Fraction of the displacement that acts at a point of the moved vessel, 0 to 1.
  double WeightAt(const Eigen::Vector3d& point_mm) const;

 protected:
  /// Pulse, 0 .. 1, with two continuous derivatives, at a fraction of the period, [0, 1).
  virtual double Pulse(double fraction) const = 0;

 private:
  bool Weigh(const Eigen::Vector3d& point_mm, vessel::RegionWeight& all) const;

  const Settings settings_;
  double displaced_ = 0;  ///< the present pulse
  double travel_mm_ = 0;
  double last_travel_mm_ = 0;
};

/// Largest stretch of all motions together; beyond it the vessel would nearly fold.
inline constexpr double kMostStretch = 0.8;

/// Keys common to all periodic motions.
struct MotionSpec : TableSpec {
  double amplitude_mm = 0;
  DirectionSpec direction;
  double phase = 0;
  std::vector<RegionSpec> regions;
};

const Keys<MotionSpec>& MotionKeys();

/// Throws UserError if the vessel would fold, alone or with the motions made before.
PeriodicMotion::Settings MakeMotion(const MotionSpec& spec, const EffectContext& context,
                                    double period_s);

}  // namespace torquer::effects
