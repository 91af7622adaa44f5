// What the wire presses on the wall with: on a stretch of given length, in all, and at the tip.
#pragma once

#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/observers/patch_force.h"

namespace torquer::effects {

/// Normal forces of the last tick, and how often and how long they were above a threshold.
///
/// The force of a contact is that of a patch: the most on any stretch of the wire of a length that
/// the scene gives, so that it does not depend on how finely the wire is cut. A tick that did not
/// converge shows its forces, but they are no peak, no event and no impulse: its time is counted
/// apart.
class WallForce final : public Effect, public Observer {
 public:
  struct Settings {
    double threshold_mN = 1;  ///< of a patch, > 0
    double tip_mm = 5;        ///< this much of the distal end is the tip
    double patch_mm = 2;      ///< length of a patch, > 0
  };
  explicit WallForce(const Settings& settings) : settings_(settings) {}

  Observer* observer() override { return this; }
  void Restart() override;
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;

  double largest_mN() const { return largest_mN_; }  ///< of a patch
  double sum_mN() const { return sum_mN_; }
  double tip_mN() const { return tip_mN_; }  ///< in all along the tip
  /// Force per length, mean over the patch with the largest force.
  double line_load_mN_mm() const { return largest_mN_ / settings_.patch_mm; }
  /// Force per area on that patch: the line load over the width with which the round wire lies in
  /// the wall, 2 sqrt(2 r d - d^2) at the patch's mean depth d <= r.
  double pressure_kPa() const { return pressure_kPa_; }
  /// The part of the forces on the last patch that runs along the wire's axis, over the area of its
  /// end, pi r^2: what may perforate a wall.
  double tip_pressure_kPa() const { return tip_pressure_kPa_; }
  double largest_ever_mN() const { return peak_mN_; }  ///< of a patch, since the start
  double tip_pressure_ever_kPa() const { return tip_pressure_peak_kPa_; }  ///< since the start
  double impulse_mNs() const { return impulse_mNs_; }  ///< of the sum, since the start
  int events() const { return events_; }               ///< times that the threshold was passed
  double seconds_above() const { return seconds_above_; }
  double event_began_s() const { return event_began_s_; }  ///< of the newest event; -1 before one
  double event_mN() const { return event_mN_; }            ///< largest force of a patch in it
  double unconverged_s() const { return unconverged_s_; }  ///< of ticks that are not counted

 private:
  void FindForces(const TickView& tick);
  void AddContact(const PointSet& points, int q);
  double PressureOn(const SpreadAlong::Stretch& patch) const;

  const Settings settings_;
  SpreadAlong force_mN_;
  SpreadAlong depth_mm2_;
  SpreadAlong radius_mm_mN_;
  double largest_mN_ = 0;
  double sum_mN_ = 0;
  double tip_mN_ = 0;
  double pressure_kPa_ = 0;
  double axial_mN_ = 0;  // on the last patch, along the wire
  double tip_pressure_kPa_ = 0;
  double tip_pressure_peak_kPa_ = 0;
  double peak_mN_ = 0;
  double impulse_mNs_ = 0;
  bool above_ = false;
  int events_ = 0;
  double unconverged_s_ = 0;
  double seconds_above_ = 0;
  double event_began_s_ = -1;
  double event_mN_ = 0;
};

EffectKind WallForceKind();

}  // namespace torquer::effects
