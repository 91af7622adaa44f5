// Heartbeat: periodic motion of the vessel about the heart.
#pragma once

#include "host/simulator/effects/motion/periodic_motion.h"

namespace torquer::effects {

/// Pulse of a beat: out in systole, straight back in early diastole, at rest for the remainder.
class Heartbeat final : public PeriodicMotion {
 public:
  /// `systole`: fraction of a beat in which the regions move out, [0.1, 0.4].
  Heartbeat(Settings settings, double systole)
      : PeriodicMotion(std::move(settings)), systole_(systole) {}

 protected:
  double Pulse(double fraction) const override;

 private:
  const double systole_;
};

EffectKind HeartbeatKind();

}  // namespace torquer::effects
