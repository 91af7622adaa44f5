// Settings of the X-ray picture, and how a choice of the operator changes them.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/imaging/body_model.h"
#include "host/simulator/effects/imaging/ct_body.h"
#include "host/simulator/effects/imaging/fluoroscopy_projection.h"

namespace torquer::effects {

/// Scan in place of the body.
struct ScanSource {
  std::string file;         ///< path
  double picture_keV = 60;  ///< effective energy of the picture
  double ct_keV = 70;       ///< of the CT
  double blur_mm = 0.6;     ///< standard deviation of the CT's point spread
  bool operator==(const ScanSource&) const = default;
};

/// Position and field of the C-arm relative to the patient.
struct View {
  double lao_rad = 0, cra_rad = 0;
  double magnification = 0;  ///< 0: no view
  Table table;
  bool operator==(const View&) const = default;
};
View ViewOf(const Controls& controls);

struct FluoroscopySettings {
  enum class Mode : std::uint8_t {
    kPlain,
    kSubtraction,  ///< difference from the first picture since the pedal went down or the C-arm
                   ///< moved; organs that moved since then do not cancel
    kRoadmap,      ///< subtraction that keeps the densest dye so far and shows the vessels bright
    kCine          ///< kPlain, with the dose of an acquisition
  };
  static bool HasMask(Mode mode) { return mode == Mode::kSubtraction || mode == Mode::kRoadmap; }
  Mode mode = Mode::kPlain;
  CArm arm;
  Body body;
  std::shared_ptr<const CtBody> scan;  ///< in place of `body`; null for none
  ScanSource scan_source;              ///< of `scan`
  double pictures_per_s = 15;
  /// Unscattered photons per pixel behind the mean of the body, in fluoroscopy.
  double photons = 600;
  double scatter_to_primary =
      0;              ///< ratio of scattered to unscattered photons, the same in every pixel
  double gain = 0.4;  ///< in units of the gray range, for a factor e in intensity
  double iodine_1_mm_mg_mL = 7.6e-4;  ///< attenuation per concentration
  // Properties of the tube.
  double tube_kV = 80;  ///< peak voltage, to which attenuation and output belong
  double tube_mA = 10;  ///< of a fluoroscopic pulse through 200 mm of tissue
  double tube_limit_mA = 1000;
  double acquisition_dose = 10;  ///< dose of kSubtraction and kCine over that of the other modes
  double pulse_ms = 8;           ///< duration of one picture's pulse
  double tube_mGy_mAs = 0.06;    ///< air kerma at 1 m
  std::uint64_t seed = 1;

  /// Mode and pulse rate (1/s) under the operator's choice.
  Mode ModeOf(const Imaging& imaging) const;
  double PulsesPerS(const Imaging& imaging) const;
  /// C-arm with the chosen field, and with its isocenter in the patient on the moved table.
  CArm ArmOf(const Controls& controls) const;
  Projection ProjectionOf(const Controls& controls) const;
  /// Line integral through the body along the middle ray, and through 200 mm of its tissue.
  double MiddleIntegralOf(const Projection& projection) const;
  double ReferenceIntegral() const;
};

}  // namespace torquer::effects
