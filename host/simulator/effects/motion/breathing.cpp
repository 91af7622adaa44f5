#include "host/simulator/effects/motion/breathing.h"

#include "host/simulator/vessel/smooth_step.h"

namespace torquer::effects {

double Breathing::Pulse(double fraction) const {
  if (fraction < inhale_ + hold_) return vessel::SmoothStep(fraction / inhale_).value;
  return 1 - vessel::SmoothStep((fraction - inhale_ - hold_) / exhale_).value;
}

namespace {

struct BreathingSpec : MotionSpec {
  double rate_per_min = 14;
  double inhale = 0.35;
  double hold = 0.1;
  double exhale = 0.45;
};

const Keys<BreathingSpec>& BreathingKeys() {
  static const Keys<BreathingSpec> keys =
      Keys<BreathingSpec>()
          .Number("rate_per_min", &BreathingSpec::rate_per_min, 2, 60, "1/min", "breathing rate")
          .Number("inhale", &BreathingSpec::inhale, 0.1, 0.5, "",
                  "inhalation time, as a fraction of the breath")
          .Number("hold", &BreathingSpec::hold, 0, 0.5, "",
                  "time of the held breath after inhalation, as a fraction of the breath")
          .Number("exhale", &BreathingSpec::exhale, 0.1, 0.8, "",
                  "exhalation time, as a fraction of the breath; the remainder is a pause")
          .Include(MotionKeys())
          .Checked([](const BreathingSpec& spec, StrictTable& table) {
            if (spec.inhale + spec.hold + spec.exhale <= 1) return;
            table.Refuse("exhale", "the sum of inhale, hold and exhale must be at most 1");
          })
          .Example(
              "rate_per_min = 14\n"
              "amplitude_mm = 6\n"
              "direction = \"inferior\"\n"
              "[[effects.breathing.region]]\n"
              "side_of_mm = [0, 0, -30]\n"
              "side = [0, 0, -1]\n"
              "edge_mm = 41\n");
  return keys;
}

std::unique_ptr<Effect> MakeBreathing(const BreathingSpec& spec, const EffectContext& context) {
  return std::make_unique<Breathing>(MakeMotion(spec, context, 60 / spec.rate_per_min), spec.inhale,
                                     spec.hold, spec.exhale);
}

}  // namespace

EffectKind BreathingKind() {
  return {.name = "breathing",
          .summary = "periodic motion of vessel regions with the breath",
          .roles = "vessel motion",
          .keys = Any(BreathingKeys()),
          .make = MakeWith(MakeBreathing)};
}

}  // namespace torquer::effects
