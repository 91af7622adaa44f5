#include "host/simulator/effects/imaging/dose_meter.h"

#include <cmath>

#include "host/simulator/effects/imaging/wedge_filters.h"

namespace torquer::effects {

namespace {

// Distance of the interventional reference point (IEC 60601-2-43) from the isocenter.
constexpr double kBeforeIsocenterMm = 150;

double FieldMm(const CArm& arm) { return arm.detector_mm * arm.sod_mm / arm.sid_mm; }

// Air kerma of one pulse at the reference point. The tube current adapts to the body's thickness
// and the pixel size, so a pixel always gets the same dose.
double PulseKermaMGy(const FluoroscopySettings& settings, const Controls& controls) {
  const double magnification = controls.imaging.magnification;
  double mA = settings.tube_mA * magnification * magnification;
  if (settings.scan != nullptr || settings.body.width_mm > 0) {
    mA *= std::exp(settings.MiddleIntegralOf(settings.ProjectionOf(controls)) -
                   settings.ReferenceIntegral());
  }
  const double distance_m = 1e-3 * (settings.arm.sod_mm - kBeforeIsocenterMm);
  return settings.tube_mGy_mAs * mA * 1e-3 * settings.pulse_ms / (distance_m * distance_m);
}

// Open area of the beam at the reference point, between the shutters.
double OpenAreaCm2(const FluoroscopySettings& settings, const Controls& controls) {
  const Imaging& imaging = controls.imaging;
  const CArm arm = settings.ArmOf(controls);
  const double width_cm = 0.1 * arm.detector_mm * (arm.sod_mm - kBeforeIsocenterMm) / arm.sid_mm;
  const double height_cm = width_cm * arm.height / arm.width;
  return width_cm * (1 - imaging.left - imaging.right) * height_cm *
         (1 - imaging.top - imaging.bottom);
}

}  // namespace

void DoseMeter::Observe(const FluoroscopySettings& settings, double time_s,
                        const Controls& controls) {
  last_ = controls;
  if (!controls.xray) {
    was_exposed_ = false;
    return;
  }
  if (!was_exposed_) next_pulse_s_ = time_s;
  was_exposed_ = true;
  if (const View view = ViewOf(controls); view != pulse_view_) {
    pulse_view_ = view;
    pulse_mGy_ = PulseKermaMGy(settings, controls);
  }
  if (const Imaging& imaging = controls.imaging; imaging != wedge_imaging_) {
    wedge_imaging_ = imaging;
    const double aspect = static_cast<double>(settings.arm.height) / settings.arm.width;
    wedge_transmission_ = WedgeShadows(imaging, aspect).MeanTransmission(imaging);
  }
  constexpr double kEarlyS = 5e-4;  // half a tick
  while (time_s >= next_pulse_s_ - kEarlyS) {
    next_pulse_s_ += 1 / settings.PulsesPerS(controls.imaging);
    ++pulses_;
    air_kerma_mGy_ += pulse_mGy_;
    kerma_area_Gy_cm2_ += 1e-3 * pulse_mGy_ * OpenAreaCm2(settings, controls) * wedge_transmission_;
  }
}

std::vector<Reading> DoseMeter::Readings(const FluoroscopySettings& settings) const {
  return {{"xray_pulses", static_cast<double>(pulses_)},
          {"air_kerma_mGy", air_kerma_mGy_},
          {"kerma_area_Gy_cm2", kerma_area_Gy_cm2_},
          {"xray_field_mm", FieldMm(settings.ArmOf(last_))}};
}

}  // namespace torquer::effects
