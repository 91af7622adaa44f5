// The vessel about a beating heart.
#pragma once

#include "host/simulator/effects/motion/periodic_motion.h"

namespace torquer::effects {

/// Out in systole, back at once in early diastole, at rest for what is left of the beat.
class Heartbeat final : public PeriodicMotion {
 public:
  /// `systole`: part of a beat in which the regions go out, [0.1, 0.4].
  Heartbeat(Settings settings, double systole)
      : PeriodicMotion(std::move(settings)), systole_(systole) {}

 protected:
  double Pulse(double part) const override;

 private:
  const double systole_;
};

EffectKind HeartbeatKind();

}  // namespace torquer::effects
