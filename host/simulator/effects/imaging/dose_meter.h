// Dose of the X-rays: pulses, air kerma and kerma-area product.
#pragma once

#include <cstdint>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/imaging/exposure.h"
#include "host/simulator/effects/imaging/fluoroscopy_settings.h"

namespace torquer::effects {

/// A value: a copy counts on from the same dose. All calls of one meter get the same settings.
class DoseMeter {
 public:
  /// Counts the pulses of a tick at `time_s` (the session's), independently of the pictures, which
  /// are taken only for viewers.
  void Observe(const FluoroscopySettings& settings, double time_s, const Controls& controls);
  /// The dose since the start, the newest pulse, the rate now, the field and the distances.
  std::vector<Reading> Readings(const FluoroscopySettings& settings) const;

 private:
  std::int64_t pulses_ = 0;
  double next_pulse_s_ = 0;
  bool was_exposed_ = false;
  double air_kerma_mGy_ = 0;      // at the interventional reference point
  double kerma_area_Gy_cm2_ = 0;  // there, between the shutters and behind the wedges
  Controls last_;                 // of the last tick
  Exposure pulse_;                // in the view and mode below
  View pulse_view_;
  Imaging::Mode pulse_mode_ = Imaging::Mode::kAsScene;
  double wedge_transmission_ = 1;  // mean of the open beam with the settings below
  Imaging wedge_imaging_;
};

}  // namespace torquer::effects
