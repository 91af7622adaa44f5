#include "host/simulator/effects/imaging/exposure.h"

#include <algorithm>
#include <cmath>

namespace torquer::effects {

Exposure ExposureOf(const FluoroscopySettings& settings, const Controls& controls) {
  const Imaging& imaging = controls.imaging;
  using Mode = FluoroscopySettings::Mode;
  const Mode mode = settings.ModeOf(imaging);
  const bool is_acquisition = mode == Mode::kSubtraction || mode == Mode::kCine;
  const double dose = is_acquisition ? settings.acquisition_dose : 1;
  double wanted_mA = settings.tube_mA * dose * imaging.magnification * imaging.magnification;
  if (settings.scan != nullptr || settings.body.width_mm > 0) {
    wanted_mA *= std::exp(settings.MiddleIntegralOf(settings.ProjectionOf(controls)) -
                          settings.ReferenceIntegral());
  }
  const double tube_mA = std::min(wanted_mA, settings.tube_limit_mA);
  const double distance_m = 1e-3 * (settings.arm.sod_mm - kReferencePointMm);
  return {.tube_mA = tube_mA,
          .kerma_mGy = settings.tube_mGy_mAs * tube_mA * 1e-3 * settings.pulse_ms /
                       (distance_m * distance_m),
          .photons = settings.photons * dose * (tube_mA / wanted_mA)};
}

}  // namespace torquer::effects
