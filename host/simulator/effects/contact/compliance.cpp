#include "host/simulator/effects/contact/compliance.h"

#include <cmath>

#include "host/simulator/effects/region_spec.h"

namespace torquer::effects {

Compliance::Compliance(std::vector<RegionStiffness> regions, const EffectContext& context)
    : elsewhere_N_mm2_(context.wall.stiffness_N_mm2), moving_(context.moving) {
  for (RegionStiffness& wall : regions) {
    regions_.push_back({std::move(wall.region), std::log(wall.stiffness_N_mm2 / elsewhere_N_mm2_)});
  }
}

double Compliance::At(const Eigen::Vector3d& point_mm) const {
  const Eigen::Vector3d at = moving_ == nullptr ? point_mm : moving_->AtRest(point_mm);
  double log_factor = 0;
  bool any = false;
  for (const RegionLogStiffness& wall : regions_) {
    const double weight = wall.region.Weight(at);
    if (weight == 0) continue;
    log_factor += weight * (wall.log_stiffness - log_factor);
    any = true;
  }
  return any ? elsewhere_N_mm2_ * std::exp(log_factor) : elsewhere_N_mm2_;
}

namespace {

struct ComplianceRegionSpec : RegionSpec {
  std::optional<double> factor;
  std::optional<double> stiffness_N_mm2;
};

struct ComplianceSpec : TableSpec {
  std::vector<ComplianceRegionSpec> regions;
};

const Keys<ComplianceRegionSpec>& ComplianceRegionKeys() {
  static const Keys<ComplianceRegionSpec> keys =
      Keys<ComplianceRegionSpec>()
          .Include(RegionKeys())
          .Otherwise("give stiffness_N_mm2")
          .Number("factor", &ComplianceRegionSpec::factor, 1e-4, 1e4, "",
                  "factor on vessel.wall_stiffness_N_mm2 in the region")
          .Otherwise("give factor")
          .Number("stiffness_N_mm2", &ComplianceRegionSpec::stiffness_N_mm2, 1e-6, 1e3, "N/mm^2",
                  "stiffness of the wall in the region, per length of wire")
          .Checked([](const ComplianceRegionSpec& spec, StrictTable& table) {
            if (spec.factor.has_value() != spec.stiffness_N_mm2.has_value()) return;
            table.Refuse("factor", "give either factor or stiffness_N_mm2, not both or none");
          });
  return keys;
}

const Keys<ComplianceSpec>& ComplianceKeys() {
  static const Keys<ComplianceSpec> keys =
      Keys<ComplianceSpec>()
          .Tables(
              "region", &ComplianceSpec::regions, ComplianceRegionKeys(), 1,
              "regions of the wall with another stiffness; a later region overrides an earlier "
              "one; "
              "across a soft edge the logarithm of the stiffness changes evenly with the weight")
          .Example(
              "[[effects.compliance.region]]\n"
              "centerline = \"lad\"\n"
              "from_mm = 50\n"
              "to_mm = 65\n"
              "radius_mm = 3\n"
              "stiffness_N_mm2 = 15\n");
  return keys;
}

std::unique_ptr<Effect> MakeCompliance(const ComplianceSpec& spec, const EffectContext& context) {
  std::vector<Compliance::RegionStiffness> regions;
  for (const ComplianceRegionSpec& wall : spec.regions) {
    const double stiffness =
        wall.factor ? *wall.factor * context.wall.stiffness_N_mm2 : *wall.stiffness_N_mm2;
    regions.push_back({MakeRegion(wall, context), stiffness});
  }
  return std::make_unique<Compliance>(std::move(regions), context);
}

}  // namespace

EffectKind ComplianceKind() {
  return {.name = "compliance",
          .summary = "softer or harder walls in regions of the vessel, such as calcified walls",
          .roles = "wall stiffness",
          .keys = Any(ComplianceKeys()),
          .make = MakeWith(MakeCompliance)};
}

}  // namespace torquer::effects
