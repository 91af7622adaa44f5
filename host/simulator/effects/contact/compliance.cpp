#include "host/simulator/effects/contact/compliance.h"

#include <cmath>

#include "host/simulator/effects/region_spec.h"

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

namespace {

struct CompliancePartSpec : RegionSpec {
  std::optional<double> factor;
  std::optional<double> stiffness_N_mm2;
};

struct ComplianceSpec : TableSpec {
  std::vector<CompliancePartSpec> regions;
};

const Keys<CompliancePartSpec>& CompliancePartKeys() {
  static const Keys<CompliancePartSpec> keys =
      Keys<CompliancePartSpec>()
          .Include(RegionKeys())
          .Otherwise("give stiffness_N_mm2")
          .Number("factor", &CompliancePartSpec::factor, 1e-4, 1e4, "",
                  "factor on vessel.wall_stiffness_N_mm2 in the region")
          .Otherwise("give factor")
          .Number("stiffness_N_mm2", &CompliancePartSpec::stiffness_N_mm2, 1e-6, 1e3, "N/mm^2",
                  "stiffness of the wall in the region, per length of wire")
          .Checked([](const CompliancePartSpec& spec, StrictTable& table) {
            if (spec.factor.has_value() != spec.stiffness_N_mm2.has_value()) return;
            table.Refuse("factor", "give either factor or stiffness_N_mm2, not both or none");
          });
  return keys;
}

const Keys<ComplianceSpec>& ComplianceKeys() {
  static const Keys<ComplianceSpec> keys =
      Keys<ComplianceSpec>()
          .Tables(
              "region", &ComplianceSpec::regions, CompliancePartKeys(), 1,
              "regions of the wall with another stiffness; a later region overrides an earlier one")
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
  std::vector<Compliance::Part> parts;
  for (const CompliancePartSpec& part : spec.regions) {
    const double stiffness =
        part.factor ? *part.factor * context.wall.stiffness_N_mm2 : *part.stiffness_N_mm2;
    parts.push_back({MakeRegion(part, context), stiffness});
  }
  return std::make_unique<Compliance>(std::move(parts), context);
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
