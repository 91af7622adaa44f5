// What the wire presses on the wall with: by contact, in all, and at the tip.
#pragma once

#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// Normal forces of the last tick, and how often and how long they were above a threshold.
class WallForce final : public Effect, public Observer {
 public:
  /// threshold_mN > 0 of a single contact; tip_mm: contacts within this distance from the distal
  /// end are the tip's.
  WallForce(double threshold_mN, double tip_mm) : threshold_mN_(threshold_mN), tip_mm_(tip_mm) {}

  Observer* observer() override { return this; }
  void Restart() override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;

  double largest_mN() const { return largest_mN_; }  ///< of one contact
  double sum_mN() const { return sum_mN_; }
  double tip_mN() const { return tip_mN_; }            ///< sum over the tip's contacts
  double largest_ever_mN() const { return peak_mN_; }  ///< of one contact, since the start
  double impulse_mNs() const { return impulse_mNs_; }  ///< of the sum, since the start
  int events() const { return events_; }               ///< times that the threshold was passed
  double seconds_above() const { return seconds_above_; }
  double event_began_s() const { return event_began_s_; }  ///< of the newest event; -1 before one
  double event_mN() const { return event_mN_; }            ///< largest force of one contact in it

 private:
  const double threshold_mN_;
  const double tip_mm_;
  double largest_mN_ = 0;
  double sum_mN_ = 0;
  double tip_mN_ = 0;
  double peak_mN_ = 0;
  double impulse_mNs_ = 0;
  int events_ = 0;
  double seconds_above_ = 0;
  double event_began_s_ = -1;
  double event_mN_ = 0;
};

EffectKind WallForceKind();

}  // namespace torquer::effects
