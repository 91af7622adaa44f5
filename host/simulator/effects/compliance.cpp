#include "host/simulator/effects/compliance.h"

#include <cmath>

#include "host/simulator/effects/region_keys.h"

namespace torquer::effects {

Compliance::Compliance(std::vector<Part> parts, const EffectContext& context)
    : elsewhere_N_mm2_(context.wall.stiffness_N_mm2), moving_(context.moving) {
  for (Part& part : parts) {
    parts_.push_back({std::move(part.region), std::log(part.stiffness_N_mm2 / elsewhere_N_mm2_)});
  }
}

double Compliance::At(const Eigen::Vector3d& point_mm) const {
  const Eigen::Vector3d at = moving_ == nullptr ? point_mm : moving_->AtRest(point_mm);
  double log_factor = 0;
  bool any = false;
  for (const LogPart& part : parts_) {
    const double weight = part.region.Weight(at);
    if (weight == 0) continue;
    log_factor += weight * (part.log_stiffness - log_factor);
    any = true;
  }
  return any ? elsewhere_N_mm2_ * std::exp(log_factor) : elsewhere_N_mm2_;
}

EffectKind ComplianceKind() {
  return {
      .name = "compliance",
      .summary = "walls that are softer or harder, as calcified ones are, in parts of the vessel",
      .roles = "wall stiffness",
      .keys = {},
      .other_keys =
          RegionKeys({{"region.factor", "1e-4 to 1e4; this or stiffness_N_mm2",
                       "times vessel.wall_stiffness_N_mm2"},
                      {"region.stiffness_N_mm2", "1e-6 to 1000 N/mm^2", "of the wall there"}}),
      .needs = "",
      .make = [](StrictTable& keys, const EffectContext& context) -> std::unique_ptr<Effect> {
        std::vector<Compliance::Part> parts;
        for (StrictTable* region : keys.Tables("region")) {
          if (region->Has("factor") == region->Has("stiffness_N_mm2")) {
            region->Refuse("factor", "give either factor or stiffness_N_mm2, not both");
          }
          const double stiffness =
              region->Has("factor")
                  ? region->Number("factor", 1e-4, 1e4) * context.wall.stiffness_N_mm2
                  : region->Number("stiffness_N_mm2", 1e-6, 1e3);
          parts.push_back({ReadRegion(*region, context), stiffness});
        }
        if (parts.empty()) {
          keys.Refuse("region", "is missing; add a table [[effects.compliance.region]]");
        }
        return std::make_unique<Compliance>(std::move(parts), context);
      }};
}

}  // namespace torquer::effects
