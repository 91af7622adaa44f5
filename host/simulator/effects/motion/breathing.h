// Breathing: periodic motion of the vessel below the diaphragm.
#pragma once

#include "host/simulator/effects/motion/periodic_motion.h"

namespace torquer::effects {

/// Pulse of a breath: slow inhalation, a short hold, slow exhalation, a pause.
class Breathing final : public PeriodicMotion {
 public:
  /// Fractions of a breath, > 0, together at most 1; the pause is the remainder.
  Breathing(Settings settings, double inhale, double hold, double exhale)
      : PeriodicMotion(std::move(settings)), inhale_(inhale), hold_(hold), exhale_(exhale) {}

 protected:
  double Pulse(double fraction) const override;

 private:
  const double inhale_;
  const double hold_;
  const double exhale_;
};

EffectKind BreathingKind();

}  // namespace torquer::effects
