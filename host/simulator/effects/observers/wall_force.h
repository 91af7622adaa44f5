// Wall force: the contact force on the wall on a stretch of given length, in total, and at the tip.
#pragma once

#include <limits>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/observers/patch_force.h"

namespace torquer::effects {

/// Normal forces of the last tick, and number and duration of the times above a threshold.
///
/// The force of a contact is the sum over a patch: a stretch with the scene's patch length. The
/// largest such sum counts. So it does not depend on the segmentation of the wire. The forces of a
/// tick that did not converge are NaN: not known. They count for no peak, event or impulse. The
/// time of such ticks is counted separately. Peaks, events and impulse are NaN until a tick has
/// converged.
class WallForce final : public Effect, public Observer {
 public:
  struct Settings {
    double threshold_mN = 1;  ///< of a patch, > 0
    double tip_mm = 5;        ///< length of the distal end that counts as the tip
    double patch_mm = 2;      ///< length of a patch, > 0
  };
  explicit WallForce(const Settings& settings) : settings_(settings) {}

  Observer* observer() override { return this; }
  void Restart() override;
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;

  double largest_mN() const { return Now(largest_mN_); }  ///< of a patch
  double sum_mN() const { return Now(sum_mN_); }
  /// Total along the tip. For two wires beside each other, the value of the tip with the larger
  /// force.
  double tip_mN() const { return Now(tip_mN_); }
  /// Mean force per length on the patch with the largest force.
  double line_load_mN_mm() const { return Now(largest_mN_) / settings_.patch_mm; }
  /// Force per area on that patch: the line load over the width of the round wire in the wall. That
  /// width is 2 sqrt(2 r d - d^2) at the patch's mean depth d <= r.
  double pressure_kPa() const { return Now(pressure_kPa_); }
  /// Axial pressure at the tip, which may perforate a wall. It is the last patch's axial force over
  /// the area pi r^2 of the wire's end. Of two wires beside each other, the larger one.
  double tip_pressure_kPa() const { return Now(tip_pressure_kPa_); }
  /// Largest force of a patch since the start; NaN if no tick has converged.
  double largest_ever_mN() const { return Counted(peak_mN_); }
  /// True after a tick that did not converge. The largest force since the start is then a lower
  /// bound.
  bool missed_any() const { return missed_any_; }
  /// Since the start; NaN if no tick has converged.
  double tip_pressure_ever_kPa() const { return Counted(tip_pressure_peak_kPa_); }
  /// Integral of the sum since the start; NaN if no tick has converged.
  double impulse_mNs() const { return Counted(impulse_mNs_); }
  int events() const { return events_; }  ///< number of times that the threshold was exceeded
  double seconds_above() const { return seconds_above_; }
  double event_began_s() const { return OfEvent(event_began_s_); }  ///< NaN without an event
  /// Largest force of a patch in the newest event; NaN without an event.
  double event_mN() const { return OfEvent(event_mN_); }
  double unconverged_s() const { return unconverged_s_; }  ///< total time of uncounted ticks

 private:
  // Value of the last tick; NaN if it did not converge.
  double Now(double value) const {
    return knows_forces_ ? value : std::numeric_limits<double>::quiet_NaN();
  }
  // Value of a measure over converged ticks; NaN without such a tick.
  double Counted(double value) const {
    return any_converged_ ? value : std::numeric_limits<double>::quiet_NaN();
  }
  double OfEvent(double value) const {
    return events_ > 0 ? value : std::numeric_limits<double>::quiet_NaN();
  }
  void FindForces(const TickView& tick);
  void FindTips(const TickView& tick);
  // Contacts of curves within each other, along the way from the farthest tip of all curves.
  struct Contacts {
    SpreadAlong force_mN;
    SpreadAlong depth_mm2;
    SpreadAlong radius_mm_mN;
    double axial_mN = 0;       // on the last patch, along the wire
    double behind_mm = 0;      // distance of their farthest tip behind that of all curves
    double end_radius_mm = 1;  // of the wire at that tip
    void Clear();
    double TipPressureKPa() const;
  };
  void AddContact(const PointSet& points, int q, Contacts& contacts);
  double PressureOn(const Contacts& contacts, const SpreadAlong::Stretch& patch) const;

  const Settings settings_;
  Contacts contacts_;         // of the farthest curve and of those within and around it
  Contacts beside_contacts_;  // of those beside it; no patch is on both
  double largest_mN_ = 0;
  double sum_mN_ = 0;
  double tip_mN_ = 0;
  double pressure_kPa_ = 0;
  double tip_pressure_kPa_ = 0;
  double tip_pressure_peak_kPa_ = 0;
  double peak_mN_ = 0;
  double impulse_mNs_ = 0;
  bool knows_forces_ = false;
  bool any_converged_ = false;
  bool missed_any_ = false;
  bool above_ = false;
  int events_ = 0;
  double unconverged_s_ = 0;
  double seconds_above_ = 0;
  double event_began_s_ = 0;  // of the newest event
  double event_mN_ = 0;       // largest force in it
};

EffectKind WallForceKind();

}  // namespace torquer::effects
