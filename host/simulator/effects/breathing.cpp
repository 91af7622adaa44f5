#include "host/simulator/effects/breathing.h"

#include "host/simulator/vessel/smooth_step.h"

namespace torquer::effects {

double Breathing::Pulse(double part) const {
  if (part < inhale_ + hold_) return vessel::SmoothStep(part / inhale_).value;
  return 1 - vessel::SmoothStep((part - inhale_ - hold_) / exhale_).value;
}

EffectKind BreathingKind() {
  static const Key kRate = {"rate_per_min", "1/min", 2, 60, 14, "breaths"};
  static const Key kInhale = {"inhale", "", 0.1, 0.5, 0.35, "part of a breath that goes in"};
  static const Key kHold = {"hold", "", 0, 0.5, 0.1, "part of a breath that is held"};
  static const Key kExhale = {"exhale", "", 0.1, 0.8, 0.45, "part of a breath that goes out"};
  return {.name = "breathing",
          .summary = "parts of the vessel that move with the breath",
          .roles = "vessel motion",
          .keys = MotionKeys({kRate, kInhale, kHold, kExhale}),
          .other_keys = OtherMotionKeys(),
          .needs = "",
          .make = [](StrictTable& keys, const EffectContext& context) -> std::unique_ptr<Effect> {
            const double period_s = 60 / kRate.Read(keys);
            const double inhale = kInhale.Read(keys);
            const double hold = kHold.Read(keys);
            const double exhale = kExhale.Read(keys);
            if (inhale + hold + exhale > 1) {
              keys.Refuse("exhale", "inhale, hold and exhale are more than a breath together");
            }
            return std::make_unique<Breathing>(ReadMotion(keys, context, period_s), inhale, hold,
                                               exhale);
          }};
}

}  // namespace torquer::effects
