#include "host/simulator/effects/imaging/lateral_plane.h"

#include <utility>

#include "host/support/angles.h"

namespace torquer::effects {

LateralPlane::LateralPlane(std::unique_ptr<Fluoroscopy> plane, double lao_rad, double cra_rad)
    : plane_(std::move(plane)), lao_rad_(lao_rad), cra_rad_(cra_rad) {}

void LateralPlane::CopyFrom(const Effect& twin) {
  plane_->CopyFrom(*dynamic_cast<const LateralPlane&>(twin).plane_);
}

Controls LateralPlane::From(const Controls& first) const {
  Controls here = first;
  here.lao_rad = lao_rad_;
  here.cra_rad = cra_rad_;
  return here;
}

namespace {

TickView With(const TickView& tick, const Controls& controls) {
  return {.time_s = tick.time_s,
          .step_s = tick.step_s,
          .controls = controls,
          .target = tick.target,
          .state = tick.state,
          .quadratic = tick.quadratic,
          .report = tick.report,
          .rods = tick.rods};
}

}  // namespace

void LateralPlane::Observe(const TickView& tick) {
  const Controls here = From(tick.controls);
  plane_->Observe(With(tick, here));
}

bool LateralPlane::Take(const TickView& tick) {
  const Controls here = From(tick.controls);
  return plane_->Take(With(tick, here));
}

std::vector<Reading> LateralPlane::Readings() const {
  std::vector<Reading> readings;
  for (Reading& reading : plane_->DoseReadings()) {
    readings.push_back({"lateral_" + reading.name, reading.value});
  }
  return readings;
}

namespace {

struct LateralPlaneSpec : TableSpec {
  double lao_deg = 90;
  double cra_deg = 0;
};

const Keys<LateralPlaneSpec>& LateralPlaneKeys() {
  using Spec = LateralPlaneSpec;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Number("lao_deg", &Spec::lao_deg, -180, 180, "deg",
                  "LAO angle of the second plane's detector; negative: RAO")
          .Number("cra_deg", &Spec::cra_deg, -90, 90, "deg",
                  "CRA angle of the second plane's detector; negative: CAU")
          .Example("lao_deg = 90\n");
  return keys;
}

std::unique_ptr<Effect> MakeLateralPlane(const LateralPlaneSpec& spec,
                                         const EffectContext& context) {
  const auto* first = FindEarlier<Fluoroscopy>(context);
  FluoroscopySettings settings = first->settings();
  ++settings.seed;  // its own noise
  return std::make_unique<LateralPlane>(MakeFluoroscopy(settings, context),
                                        kRadPerDeg * spec.lao_deg, kRadPerDeg * spec.cra_deg);
}

}  // namespace

EffectKind LateralPlaneKind() {
  return {.name = "lateral_plane",
          .summary = "second picture of a biplane system, at fixed angles",
          .roles = "image, observer",
          .keys = Any(LateralPlaneKeys()),
          .needs = "fluoroscopy",
          .make = MakeWith(MakeLateralPlane)};
}

}  // namespace torquer::effects
