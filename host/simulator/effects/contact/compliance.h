// Compliance: softer or harder walls in parts of the vessel.
#pragma once

#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/vessel/region.h"

namespace torquer::effects {

/// Wall stiffness by region. Along a region's edge it changes from the surrounding stiffness to the
/// region's own, evenly in the logarithm. Later regions override earlier ones. Regions move with
/// the vessel.
class Compliance final : public Effect, public WallStiffness {
 public:
  struct RegionStiffness {
    vessel::Region region;
    double stiffness_N_mm2 = 0;  ///< > 0
  };
  Compliance(std::vector<RegionStiffness> regions, const EffectContext& context);

  const WallStiffness* wall_stiffness() override { return this; }
  double At(const Eigen::Vector3d& point_mm) const override;

 private:
  struct RegionLogStiffness {
    vessel::Region region;
    double log_stiffness;
  };
  std::vector<RegionLogStiffness> regions_;
  const double elsewhere_N_mm2_;
  const vessel::MovingField* const moving_;
};

EffectKind ComplianceKind();

}  // namespace torquer::effects
