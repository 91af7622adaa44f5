#include "host/simulator/effects/imaging/fluoroscopy_settings.h"

namespace torquer::effects {

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
  }
  return mode;
}

double FluoroscopySettings::PulsesPerS(const Imaging& imaging) const {
  return imaging.pulses_per_s > 0 ? imaging.pulses_per_s : pictures_per_s;
}

CArm FluoroscopySettings::ArmOf(const Imaging& imaging) const {
  CArm chosen = arm;
  chosen.detector_mm /= imaging.magnification;
  return chosen;
}

double FluoroscopySettings::MiddleIntegralOf(const Projection& projection) const {
  return scan != nullptr ? scan->MiddleIntegral(projection) : MiddleIntegral(projection, body);
}

double FluoroscopySettings::ReferenceIntegral() const {
  constexpr double kThicknessMm = 200;
  return kThicknessMm * (scan != nullptr ? scan->tissue_1_mm() : body.tissue_1_mm);
}

}  // namespace torquer::effects
