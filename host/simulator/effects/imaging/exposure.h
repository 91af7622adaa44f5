// Exposure of one X-ray pulse, as an automatic exposure control sets it.
#pragma once

#include "host/simulator/effects/imaging/fluoroscopy_settings.h"

namespace torquer::effects {

struct Exposure {
  double tube_mA = 0;
  double kerma_mGy = 0;  ///< air kerma at the interventional reference point (IEC 60601-2-43)
  double photons = 0;    ///< as FluoroscopySettings::photons
};

/// Distance of the interventional reference point from the isocenter, towards the tube.
constexpr double kReferencePointMm = 150;

/// Exposure for the view, field and mode of `controls`. The control keeps the dose of a pixel. A
/// picture of an acquisition, subtracted or cine, has a multiple of it. The current grows with the
/// attenuation along the middle ray, and with the square of the magnification. At the tube's limit
/// fewer photons reach a pixel.
Exposure ExposureOf(const FluoroscopySettings& settings, const Controls& controls);

}  // namespace torquer::effects
