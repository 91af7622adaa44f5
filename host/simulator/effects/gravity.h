// The wire's own weight.
#pragma once

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// A dead force per length on the whole wire, spread by the trapezoidal rule over its points.
class Gravity final : public Effect, public EnergyTerm {
 public:
  /// `weight_N_mm`: of a millimeter of wire, as a vector.
  explicit Gravity(const Eigen::Vector3d& weight_N_mm) : weight_N_mm_(weight_N_mm) {}

  EnergyTerm* energy_term() override { return this; }

  void Begin(const PointSet&) override {}
  double Add(const PointSet& points, PointDerivatives& out) const override;
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

 private:
  const Eigen::Vector3d weight_N_mm_;
};

EffectKind GravityKind();

}  // namespace torquer::effects
