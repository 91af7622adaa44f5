#include "host/simulator/effects/imaging/dose_meter.h"

#include <limits>

#include "host/simulator/effects/imaging/wedge_filters.h"

namespace torquer::effects {

namespace {

double FieldMm(const CArm& arm) { return arm.detector_mm * arm.sod_mm / arm.sid_mm; }

// Open area of the beam at the reference point, between the shutters.
double OpenAreaCm2(const FluoroscopySettings& settings, const Controls& controls) {
  const Imaging& imaging = controls.imaging;
  const CArm arm = settings.ArmOf(controls);
  const double width_cm = 0.1 * arm.detector_mm * (arm.sod_mm - kReferencePointMm) / arm.sid_mm;
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
  const View view = ViewOf(controls);
  if (view != pulse_view_ || controls.imaging.mode != pulse_mode_) {
    pulse_view_ = view;
    pulse_mode_ = controls.imaging.mode;
    pulse_ = ExposureOf(settings, controls);
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
    air_kerma_mGy_ += pulse_.kerma_mGy;
    kerma_area_Gy_cm2_ +=
        1e-3 * pulse_.kerma_mGy * OpenAreaCm2(settings, controls) * wedge_transmission_;
  }
}

std::vector<Reading> DoseMeter::Readings(const FluoroscopySettings& settings) const {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  const double rate_mGy_s =
      was_exposed_ ? pulse_.kerma_mGy * settings.PulsesPerS(last_.imaging) : 0;
  return {{"xray_pulses", static_cast<double>(pulses_)},
          {"air_kerma_mGy", air_kerma_mGy_},
          {"kerma_area_Gy_cm2", kerma_area_Gy_cm2_},
          {"xray_field_mm", FieldMm(settings.ArmOf(last_))},
          {"air_kerma_rate_mGy_min", 60 * rate_mGy_s},
          {"tube_kV", settings.tube_kV},
          {"tube_mA", pulses_ > 0 ? pulse_.tube_mA : kUnknown},
          {"source_detector_mm", settings.arm.sid_mm}};
}

}  // namespace torquer::effects
