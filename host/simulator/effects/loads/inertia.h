// Inertia of the instruments, and the drag of the blood: snaps take time.
//
// A part of a motion (0.25 mm at most, or a tick in which the hands rest) is an implicit Euler step
// of the time dt that it takes: the energy is minimized together with
//   m / (2 dt^2) |x - x0 - v dt|^2 + c / (2 dt) |x - x0|^2
// at every point of the wire, x0 and v being position and velocity of the same material when the
// part began. Its minimum is m a = -grad E - c v at the end of the step; no unknown is added.
//
// Position and velocity are remembered by the distance from the tip, which is what stays the same
// of a place of the material while the wire is fed. At a fixed distance from the sheath the
// material changes, and the acceleration would need the terms of convection. What lies in the
// sheath is straight and moves as the hand does. Of two curves each remembers its own material, by
// the distance from its own tip.
#pragma once

#include <array>
#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

class Inertia final : public Effect, public EnergyTerm, public Timed, public Observer {
 public:
  struct Settings {
    /// Of each instrument, the innermost first, less what it displaces of the fluid; >= 0, g/m.
    std::vector<double> linear_density_g_m;
    double fluid_kg_m3 = 0;  ///< density of what surrounds and fills the instruments, >= 0
    double drag_mPa_s = 0;   ///< force of the fluid per length and velocity, >= 0
  };
  Inertia(Settings settings, const EffectContext& context);

  EnergyTerm* energy_term() override { return this; }
  void CopyFrom(const Effect& twin) override;
  Timed* timed() override { return this; }
  Observer* observer() override { return this; }

  /// That of the step is neither stored nor lost: the reading kinetic_energy_mJ has what is stored.
  bool Dissipates() const override { return true; }

  void Lapse(double step_s) override { left_s_ += step_s; }
  void Begin(const PointSet& points) override;
  void TakeShare(double share) override { part_s_ = share * left_s_; }
  double Add(const PointSet& points, PointDerivatives& out) const override;
  void End(const PointSet& points) override;
  void Reset() override;
  std::uint64_t Hash(std::uint64_t seed) const override;

  void Observe(const TickView& /*tick*/) override {}
  std::vector<Reading> Readings() const override { return {{"kinetic_energy_mJ", kinetic_mJ_}}; }

 private:
  // Material of the wire when the part began.
  struct Material {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();  // mm
    Eigen::Vector3d velocity_mm_s = Eigen::Vector3d::Zero();
  };

  // A curve when the part began.
  struct Curve {
    std::vector<Material> material;  // of the points that keep their material, from the tip on
    int known = 0;                   // of these
    double beyond_tip_mm = 0;        // how far the first of them is beyond the tip
    double inserted_mm = 0;
    double fed_mm_s = 0;  // velocity of what is in the sheath
  };

  // A curve of the points beside what is remembered of it.
  struct Seen {
    const PointSet& points;
    const Curve& curve;
    int last;          // of its points
    double behind_mm;  // its tip, behind the distal end
    double moved;      // how many pieces its points have moved along its material
  };

  // Which of the two curves of `points` that is: 0 that of the innermost instrument, 1 the other.
  static std::size_t NumberOf(const PointSet& points, bool second);
  Seen See(const PointSet& points, bool second) const;
  Material Before(const Seen& seen, int q) const;
  double DensityAt(const PointSet& points, bool second, int q) const;
  static void Remember(const PointSet& points, bool second, Curve& curve);

  const Settings settings_;
  const Sheath sheath_;
  std::array<Curve, 2> curves_;  // by NumberOf; of one curve the first alone
  std::vector<Material> next_;   // while a part ends: those of one curve
  bool begun_ = false;           // since Reset
  double left_s_ = 0;            // time that no part has simulated
  double part_s_ = 0;            // what the present part takes of it
  double kinetic_mJ_ = 0;        // when the last part ended
};

EffectKind InertiaKind();

}  // namespace torquer::effects
