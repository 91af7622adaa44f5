#include "host/simulator/effects/imaging/fluoroscopy_settings.h"

namespace torquer::effects {

View ViewOf(const Controls& controls) {
  return {controls.lao_rad, controls.cra_rad, controls.imaging.magnification, controls.table};
}

FluoroscopySettings::Mode FluoroscopySettings::ModeOf(const Imaging& imaging) const {
  switch (imaging.mode) {
    case Imaging::Mode::kAsScene:
      break;
    case Imaging::Mode::kPlain:
      return Mode::kPlain;
    case Imaging::Mode::kSubtraction:
      return Mode::kSubtraction;
    case Imaging::Mode::kRoadmap:
      return Mode::kRoadmap;
    case Imaging::Mode::kCine:
      return Mode::kCine;
  }
  return mode;
}

double FluoroscopySettings::PulsesPerS(const Imaging& imaging) const {
  return imaging.pulses_per_s > 0 ? imaging.pulses_per_s : pictures_per_s;
}

CArm FluoroscopySettings::ArmOf(const Controls& controls) const {
  CArm chosen = arm;
  chosen.detector_mm /= controls.imaging.magnification;
  const Table& table = controls.table;
  // In the patient's frame the C-arm moves the other way.
  chosen.isocenter_mm -= table.left_mm * arm.axes.left + table.head_mm * arm.axes.superior -
                         table.height_mm * arm.axes.posterior;
  return chosen;
}

Projection FluoroscopySettings::ProjectionOf(const Controls& controls) const {
  return {ArmOf(controls), controls.lao_rad, controls.cra_rad};
}

double FluoroscopySettings::MiddleIntegralOf(const Projection& projection) const {
  return scan != nullptr ? scan->MiddleIntegral(projection) : MiddleIntegral(projection, body);
}

double FluoroscopySettings::ReferenceIntegral() const {
  constexpr double kThicknessMm = 200;
  return kThicknessMm * (scan != nullptr ? scan->tissue_1_mm() : body.tissue_1_mm);
}

}  // namespace torquer::effects
