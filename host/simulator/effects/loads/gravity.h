// Gravity: the weight of the instruments.
#pragma once

#include <utility>
#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// Constant force per length of each instrument, distributed over the points of its curve by the
/// trapezoidal rule.
class Gravity final : public Effect, public EnergyTerm {
 public:
  /// `weights_N_mm`: weight per millimeter of each instrument, the innermost first, as vectors.
  explicit Gravity(std::vector<Eigen::Vector3d> weights_N_mm)
      : weights_N_mm_(std::move(weights_N_mm)) {}

  EnergyTerm* energy_term() override { return this; }

  void Begin(const PointSet&) override {}
  double Add(const PointSet& points, PointDerivatives& out) const override;
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

 private:
  const std::vector<Eigen::Vector3d> weights_N_mm_;
};

EffectKind GravityKind();

}  // namespace torquer::effects
