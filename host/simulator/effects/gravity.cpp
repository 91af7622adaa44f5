#include "host/simulator/effects/gravity.h"

#include "host/simulator/effects/region_keys.h"

namespace torquer::effects {

double Gravity::Add(const PointSet& points, PointDerivatives& out) const {
  double energy = 0;
  const int count = points.size();
  for (int q = 0; q < count; ++q) {
    const auto p = static_cast<std::size_t>(q);
    // Half of the piece before the point and half of that beyond; the sheath carries the rest.
    const double length_mm =
        (points.weight_mm[p] + (q + 1 < count ? points.weight_mm[p + 1] : 0)) / 2;
    out.TouchGradient(q);
    out.gradient[p] -= length_mm * weight_N_mm_;
    energy -= length_mm * weight_N_mm_.dot(points.position[p]);
  }
  return energy;
}

EffectKind GravityKind() {
  static const Key kDensity = {"linear_density_g_m",
                               "g/m",
                               1e-4,
                               1000,
                               std::nullopt,
                               "mass of the wire, less that of the blood it displaces"};
  static const Key kAcceleration = {"acceleration_m_s2", "m/s^2", 0, 1000, 9.81, "of gravity"};
  return {.name = "gravity",
          .summary = "the wire's own weight",
          .roles = "energy term",
          .keys = {kDensity, kAcceleration},
          .other_keys = {{"direction",
                          "[x, y, z] or left, right, anterior, posterior, superior, inferior; if "
                          "not given posterior",
                          "where things fall to; posterior: the patient lies on the back"}},
          .needs = "",
          .make = [](StrictTable& keys, const EffectContext& context) -> std::unique_ptr<Effect> {
            const double density_kg_mm = 1e-6 * kDensity.Read(keys);
            const Eigen::Vector3d direction = keys.Has("direction")
                                                  ? ReadPatientDirection(keys, "direction", context)
                                                  : context.axes.posterior;
            return std::make_unique<Gravity>(density_kg_mm * kAcceleration.Read(keys) * direction);
          }};
}

}  // namespace torquer::effects
