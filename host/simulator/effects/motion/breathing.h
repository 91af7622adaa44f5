// The vessel below a moving diaphragm.
#pragma once

#include "host/simulator/effects/motion/periodic_motion.h"

namespace torquer::effects {

/// Slowly in, a short hold, slowly out, a pause.
class Breathing final : public PeriodicMotion {
 public:
  /// Parts of a breath, > 0, together at most 1; the pause takes what is left.
  Breathing(Settings settings, double inhale, double hold, double exhale)
      : PeriodicMotion(std::move(settings)), inhale_(inhale), hold_(hold), exhale_(exhale) {}

 protected:
  double Pulse(double part) const override;

 private:
  const double inhale_;
  const double hold_;
  const double exhale_;
};

EffectKind BreathingKind();

}  // namespace torquer::effects
