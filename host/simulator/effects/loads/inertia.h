// Inertia of the instruments, and the drag of the blood: snaps take time.
//
// A part of a motion is at most 0.25 mm, or a tick in which the hands rest. It is one backward
// Euler step of its duration dt: the energy is minimized together with
//   m / (2 dt^2) |x - x0 - v dt|^2 + c / (2 dt) |x - x0|^2
// at every point of the wire. Here x0 and v are position and velocity of the same material when the
// part began. At the minimum m a = -grad E - c v holds at the end of the step; no unknown is added.
//
// Position and velocity are stored by the distance from the tip. This distance is constant for a
// material point during a feed. At a fixed distance from the sheath the material changes, and the
// acceleration would need convection terms. The part of the wire in the sheath is straight and
// moves with the hand. Each curve stores its own material, by the distance from its own
// tip.
#pragma once

#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

class Inertia final : public Effect,
                      public EnergyTerm,
                      public TimedTerm,
                      public Timed,
                      public Observer {
 public:
  struct Settings {
    /// Per instrument, the innermost first: linear density less that of the displaced fluid; >= 0,
    /// g/m.
    std::vector<double> linear_density_g_m;
    double fluid_kg_m3 = 0;  ///< density of the fluid around and in the instruments, >= 0
    double drag_mPa_s = 0;   ///< force of the fluid per length and velocity, >= 0
  };
  Inertia(Settings settings, const EffectContext& context);

  EnergyTerm* energy_term() override { return this; }
  TimedTerm* timed_term() override { return this; }
  void CopyFrom(const Effect& twin) override;
  Timed* timed() override { return this; }
  Observer* observer() override { return this; }

  /// The energy of the step is neither stored nor lost; the reading kinetic_energy_mJ has the
  /// stored energy.
  bool Dissipates() const override { return true; }

  void AdvanceTime(double step_s) override { left_s_ += step_s; }
  void Begin(const PointSet& points) override;
  void SetMotionFraction(double fraction) override { part_s_ = fraction * left_s_; }
  double Add(const PointSet& points, PointDerivatives& out) const override;
  void End(const PointSet& points) override;
  void Reset() override;
  std::uint64_t Hash(std::uint64_t seed) const override;

  void Observe(const TickView& /*tick*/) override {}
  std::vector<Reading> Readings() const override { return {{"kinetic_energy_mJ", kinetic_mJ_}}; }

 private:
  // State of the material when the part began.
  struct Material {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();  // mm
    Eigen::Vector3d velocity_mm_s = Eigen::Vector3d::Zero();
  };

  // State of a curve when the part began.
  struct Curve {
    Sheath sheath;
    std::vector<Material> material;  // of the points that keep their material, ordered from the tip
    int known = 0;                   // number of valid entries of material
    bool begun = false;              // Begin was called since Reset
    double inserted_mm = 0;
    double fed_mm_s = 0;  // velocity of the part in the sheath
  };

  const Curve& CurveOf(const PointSet& points) const {
    return curves_[static_cast<std::size_t>(points.among.curve)];
  }
  Material Before(const PointSet& points, int q) const;
  double SquaredRadius(const PointSet& points, int q) const;
  double DensityAt(const PointSet& points, int q) const;
  static void Remember(const PointSet& points, Curve& curve);

  const Settings settings_;
  const InstrumentStack* const stack_;  // null for a lone wire
  std::vector<Curve> curves_;
  std::vector<Material> next_;  // of one curve, while a part ends
  double left_s_ = 0;           // time that no part has simulated yet
  double part_s_ = 0;           // time of the present part
  double kinetic_mJ_ = 0;       // at the end of the last part
};

EffectKind InertiaKind();

}  // namespace torquer::effects
