#include <memory>
#include <optional>
#include <string>

#include "host/simulator/effects/blood/contrast.h"
#include "host/support/error.h"

namespace torquer::effects {

namespace {

using Site = ContrastSettings::Site;

struct ContrastSpec : TableSpec {
  double rate_mL_s = 0;
  double concentration_mg_mL = 320;
  double dispersion_mm2_s = 100;
  double cell_mm = 2;
  std::optional<double> patient_limit_mL;
  Site at = Site::kEntry;
  std::optional<std::string> instrument;
  std::optional<std::string> centerline;
  std::optional<double> at_mm;
  std::optional<double> injector_volume_mL;
  std::optional<double> injector_rate_mL_s;
  double injector_delay_s = 0;
  double injector_rise_s = 0;
};

void Check(const ContrastSpec& spec, StrictTable& table) {
  const bool place = spec.at == Site::kPlace;
  for (const char* key : {"centerline", "at_mm"}) {
    if (table.Has(key) == place) continue;
    table.Refuse(key, place ? "is missing; at = \"place\" needs it"
                            : "is valid only with at = \"place\"; set that, or remove this key");
  }
  const bool injector = spec.injector_volume_mL.has_value();
  if (injector && !spec.injector_rate_mL_s) {
    table.Refuse("injector_rate_mL_s",
                 "is missing; give 0.1 to 45 mL/s, which injector_volume_mL needs");
  }
  for (const char* key : {"injector_rate_mL_s", "injector_delay_s", "injector_rise_s"}) {
    if (injector || !table.Has(key)) continue;
    table.Refuse(key, "is valid only with injector_volume_mL; set that, or remove this key");
  }
  if (spec.instrument && spec.at != Site::kTip) {
    table.Refuse("instrument", "is valid only with at = \"tip\"; set that, or remove this key");
  }
}

const Keys<ContrastSpec>& ContrastKeys() {
  static const Keys<ContrastSpec> keys =
      Keys<ContrastSpec>()
          .Required()
          .Number("rate_mL_s", &ContrastSpec::rate_mL_s, 0.01, 50, "mL/s",
                  "rate of injection while the button is held")
          .Number("concentration_mg_mL", &ContrastSpec::concentration_mg_mL, 1, 500, "mg/mL",
                  "concentration of iodine in the contrast agent")
          .Number("dispersion_mm2_s", &ContrastSpec::dispersion_mm2_s, 0, 5000, "mm^2/s",
                  "dispersion coefficient of the contrast agent along the vessel")
          .Number("cell_mm", &ContrastSpec::cell_mm, 0.25, 20, "mm",
                  "length of a computing cell along the vessel")
          .Otherwise("unset: no limit is shown")
          .Number("patient_limit_mL", &ContrastSpec::patient_limit_mL, 1, 2000, "mL",
                  "largest total volume that the patient tolerates; above it, page and report warn")
          .Choice("at", &ContrastSpec::at, {"entry", "tip", "place"},
                  "place of injection: the sheath, the tip of an instrument (on the nearest "
                  "centerline), or a place on a centerline")
          .Otherwise("the innermost instrument")
          .Text("instrument", &ContrastSpec::instrument,
                "instrument whose tip injects, for at = \"tip\"")
          .Otherwise("unset: at is not \"place\"")
          .Text("centerline", &ContrastSpec::centerline,
                "centerline of the injection, for at = \"place\"")
          .Otherwise("unset: at is not \"place\"")
          .Number("at_mm", &ContrastSpec::at_mm, 0, 1e5, "mm",
                  "arc length of the injection along its centerline, for at = \"place\"")
          .Otherwise("unset: no power injector")
          .Number("injector_volume_mL", &ContrastSpec::injector_volume_mL, Injector::kLeastVolumeML,
                  Injector::kMostVolumeML, "mL",
                  "volume that the power injector injects; the page can change it and the next "
                  "three")
          .Otherwise("unset: no power injector")
          .Number("injector_rate_mL_s", &ContrastSpec::injector_rate_mL_s, Injector::kLeastRateMLS,
                  Injector::kMostRateMLS, "mL/s", "its rate; required with injector_volume_mL")
          .Number("injector_delay_s", &ContrastSpec::injector_delay_s, 0, Injector::kMostDelayS,
                  "s", "time from the order to the first agent, in which X-ray takes the mask")
          .Number("injector_rise_s", &ContrastSpec::injector_rise_s, 0, Injector::kMostRiseS, "s",
                  "time in which its rate rises linearly from 0")
          .Checked(Check)
          .Example(
              "rate_mL_s = 2\n"
              "at = \"tip\"\n"
              "instrument = \"microcatheter\"\n");
  return keys;
}

std::unique_ptr<Effect> MakeContrast(const ContrastSpec& spec, const EffectContext& context) {
  const Flow& flow = *FindEarlier<Flow>(context);
  ContrastSettings settings;
  settings.site = spec.at;
  if (spec.instrument) {
    settings.instrument = context.FindInstrument(*spec.instrument, spec, "instrument");
  }
  if (spec.centerline) {
    try {
      settings.place = flow.graph().network().Place(*spec.centerline, *spec.at_mm);
    } catch (const UserError& error) {
      spec.origin.Refuse("centerline", error.what());
    }
  }
  settings.rate_mL_s = spec.rate_mL_s;
  settings.concentration_mg_mL = spec.concentration_mg_mL;
  settings.dispersion_mm2_s = spec.dispersion_mm2_s;
  settings.cell_mm = spec.cell_mm;
  settings.patient_limit_mL = spec.patient_limit_mL;
  if (spec.injector_volume_mL) {
    settings.injector = {.volume_mL = *spec.injector_volume_mL,
                         .rate_mL_s = *spec.injector_rate_mL_s,
                         .delay_s = spec.injector_delay_s,
                         .rise_s = spec.injector_rise_s};
  }
  return std::make_unique<Contrast>(flow, settings, context.wire);
}

}  // namespace

EffectKind ContrastKind() {
  return {
      .name = "contrast",
      .summary =
          "contrast agent, injected while the button is held, carried by the flow and washed out",
      .roles = "evolution, observer",
      .keys = Any(ContrastKeys()),
      .needs = "flow",
      .make = MakeWith(MakeContrast)};
}

}  // namespace torquer::effects
