#include "host/simulator/effects/motion/heartbeat.h"

#include "host/simulator/vessel/smooth_step.h"

namespace torquer::effects {

namespace {

// Duration of the motion back in units of the motion out.
constexpr double kBack = 1.3;

}  // namespace

double Heartbeat::Pulse(double fraction) const {
  if (fraction < systole_) return vessel::SmoothStep(fraction / systole_).value;
  return 1 - vessel::SmoothStep((fraction - systole_) / (kBack * systole_)).value;
}

namespace {

struct HeartbeatSpec : MotionSpec {
  double rate_per_min = 70;
  double systole = 0.33;
};

const Keys<HeartbeatSpec>& HeartbeatKeys() {
  static const Keys<HeartbeatSpec> keys =
      Keys<HeartbeatSpec>()
          .Number("rate_per_min", &HeartbeatSpec::rate_per_min, 20, 250, "1/min", "heart rate")
          .Number("systole", &HeartbeatSpec::systole, 0.1, 0.4, "",
                  "systole: fraction of the beat during which the regions move out")
          .Include(MotionKeys())
          .Example(
              "rate_per_min = 72\n"
              "amplitude_mm = 6\n"
              "direction = [0.55, -0.35, -0.76]\n"
              "[[effects.heartbeat.region]]\n"
              "side_of_mm = [0, 0, -13]\n"
              "side = [0, 0, -1]\n"
              "edge_mm = 24\n");
  return keys;
}

std::unique_ptr<Effect> MakeHeartbeat(const HeartbeatSpec& spec, const EffectContext& context) {
  return std::make_unique<Heartbeat>(MakeMotion(spec, context, 60 / spec.rate_per_min),
                                     spec.systole);
}

}  // namespace

EffectKind HeartbeatKind() {
  return {.name = "heartbeat",
          .summary = "periodic motion of vessel regions with the heartbeat",
          .roles = "vessel motion",
          .keys = Any(HeartbeatKeys()),
          .make = MakeWith(MakeHeartbeat)};
}

}  // namespace torquer::effects
