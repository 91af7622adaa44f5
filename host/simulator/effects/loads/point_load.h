// Point load: a force, a moment or a clamp at the wire's distal end.
#pragma once

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// Loads at the distal end; zero for those absent.
struct EndLoad {
  Eigen::Vector3d force_N = Eigen::Vector3d::Zero();  ///< of constant direction
  /// Turns the last segment about `axis`. The energy is minus the moment times the angle about the
  /// axis, so the moment about it is constant. It fades if the segment is within 6 degrees of the
  /// axis. A segment along the axis cannot be turned about it.
  double moment_mJ = 0;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< unit
  double hold_N_mm = 0;                             ///< spring that pulls the end to `place_mm`
  Eigen::Vector3d place_mm = Eigen::Vector3d::Zero();
  double align_mJ = 0;  ///< moment over sine of the angle between the last segment and `direction`
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  ///< unit
};

class PointLoad final : public Effect, public EnergyTerm, public Timed {
 public:
  /// `ramp_s`: time from the start over which the loads grow from 0, in proportion; 0: they act at
  /// once.
  explicit PointLoad(const EndLoad& load, double ramp_s = 0)
      : load_(load), ramp_s_(ramp_s), fraction_(ramp_s > 0 ? 0 : 1) {}

  EnergyTerm* energy_term() override { return this; }
  Timed* timed() override { return ramp_s_ > 0 ? this : nullptr; }
  void AdvanceTime(double step_s) override { elapsed_s_ += step_s; }
  void Restart() override { elapsed_s_ = 0; }
  void CopyFrom(const Effect& twin) override;
  void SetLoad(const EndLoad& load) { load_ = load; }

  void Begin(const PointSet& points) override;
  double Add(const PointSet& points, PointDerivatives& out) const override;
  void End(const PointSet&) override {}
  void Reset() override;
  std::uint64_t Hash(std::uint64_t seed) const override;

 private:
  double Turn(const Eigen::Vector3d& tangent, TangentLoad& out) const;

  EndLoad load_;
  const double ramp_s_;
  double elapsed_s_ = 0;
  double fraction_;  ///< of the loads that acts in the present part
  /// Angle about the axis at the part's start, full turns included.
  double angle_rad_ = 0;
};

EffectKind PointLoadKind();

}  // namespace torquer::effects
