#include "host/simulator/effects/loads/gravity.h"

namespace torquer::effects {

double Gravity::Add(const PointSet& points, PointDerivatives& out) const {
  double energy = 0;
  const bool several = points.instruments.last - points.instruments.first > 1;
  for (int k = points.instruments.first; k < points.instruments.last; ++k) {
    const Eigen::Vector3d& weight_N_mm = weights_N_mm_[static_cast<std::size_t>(k)];
    for (int q = 0; q < points.size(); ++q) {
      const double coverage = several ? points.CoverageOf(k, q) : 1;
      if (coverage == 0) break;
      const auto p = static_cast<std::size_t>(q);
      const double length_mm = coverage * points.weight_mm[p];
      out.TouchGradient(q);
      out.gradient[p] -= length_mm * weight_N_mm;
      energy -= length_mm * weight_N_mm.dot(points.position[p]);
    }
  }
  return energy;
}

namespace {

struct GravitySpec : TableSpec {
  double acceleration_m_s2 = 9.81;
  DirectionSpec direction{"posterior", {}};
};

const Keys<GravitySpec>& GravityKeys() {
  static const Keys<GravitySpec> keys =
      Keys<GravitySpec>()
          .Number("acceleration_m_s2", &GravitySpec::acceleration_m_s2, 0, 1000, "m/s^2",
                  "gravitational acceleration")
          .Direction("direction", &GravitySpec::direction,
                     "direction of gravity; posterior: the patient lies on the back")
          .Example("direction = \"posterior\"\n");
  return keys;
}

std::unique_ptr<Effect> MakeGravity(const GravitySpec& spec, const EffectContext& context) {
  const Eigen::Vector3d acceleration = spec.acceleration_m_s2 * context.Direction(spec.direction);
  std::vector<Eigen::Vector3d> weights;
  bool any = false;
  for (const Instrument& instrument : context.instruments) {
    const double density_kg_mm = 1e-6 * instrument.linear_density_g_m;
    any = any || density_kg_mm > 0;
    weights.emplace_back(density_kg_mm * acceleration);
  }
  if (!any) {
    spec.origin.Refuse(
        "acceleration_m_s2",
        "no instrument has a weight; set linear_density_g_m of an instrument above 0, or "
        "remove [effects.gravity]");
  }
  return std::make_unique<Gravity>(std::move(weights));
}

}  // namespace

EffectKind GravityKind() {
  return {.name = "gravity",
          .summary = "weight of the instruments, from their linear_density_g_m",
          .roles = "energy term",
          .keys = Any(GravityKeys()),
          .make = MakeWith(MakeGravity)};
}

}  // namespace torquer::effects
