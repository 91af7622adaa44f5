#include "host/simulator/effects/heartbeat.h"

#include "host/simulator/vessel/smooth_step.h"

namespace torquer::effects {

namespace {

// The way back takes this much longer than the way out.
constexpr double kBack = 1.3;

}  // namespace

double Heartbeat::Pulse(double part) const {
  if (part < systole_) return vessel::SmoothStep(part / systole_).value;
  return 1 - vessel::SmoothStep((part - systole_) / (kBack * systole_)).value;
}

EffectKind HeartbeatKind() {
  static const Key kRate = {"rate_per_min", "1/min", 20, 250, 70, "beats"};
  static const Key kSystole = {"systole", "",   0.1,
                               0.4,       0.33, "part of a beat in which the regions go out"};
  return {.name = "heartbeat",
          .summary = "parts of the vessel that move with the heart",
          .roles = "vessel motion",
          .keys = MotionKeys({kRate, kSystole}),
          .other_keys = OtherMotionKeys(),
          .needs = "",
          .make = [](StrictTable& keys, const EffectContext& context) -> std::unique_ptr<Effect> {
            const double period_s = 60 / kRate.Read(keys);
            const double systole = kSystole.Read(keys);
            return std::make_unique<Heartbeat>(ReadMotion(keys, context, period_s), systole);
          }};
}

}  // namespace torquer::effects
