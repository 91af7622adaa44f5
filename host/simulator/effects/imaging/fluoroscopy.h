// X-ray picture: a C-arm about the patient, the wire, dye in the vessels, a body around them, and
// the quantum noise of the dose.
//
//   tick thread: Take  --nodes, dye--> newest shot -->  Render: in its own thread
#pragma once

#include <memory>
#include <vector>

#include "host/simulator/effects/blood/contrast.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/imaging/fluoroscopy_attenuation.h"
#include "host/simulator/effects/imaging/fluoroscopy_projection.h"
#include "host/simulator/effects/imaging/latest.h"

namespace torquer::effects {

struct FluoroscopySettings {
  enum class Mode : std::uint8_t {
    kPlain,
    kSubtraction,  ///< difference from the first picture since the pedal went down or the C-arm
                   ///< moved; organs that moved since then do not cancel
    kRoadmap       ///< subtraction that keeps the densest dye so far and shows the vessels bright
  };
  Mode mode = Mode::kPlain;
  CArm arm;
  Body body;
  double pictures_per_s = 15;
  double photons = 600;  ///< unscattered photons per pixel behind the mean of the body
  double scatter_to_primary =
      0;              ///< ratio of scattered to unscattered photons, the same in every pixel
  double gain = 0.4;  ///< in units of the gray range, for a factor e in intensity
  double iodine_1_mm_mg_mL = 7.6e-4;  ///< attenuation per concentration
  // Properties of the tube, for the dose.
  double tube_mA = 10;         ///< through 200 mm of tissue
  double pulse_ms = 8;         ///< duration of one picture's pulse
  double tube_mGy_mAs = 0.06;  ///< air kerma at 1 m
  std::uint64_t seed = 1;
};

/// Apparent line integral at a detector for the true one, `integral`; both relative to the mean of
/// the body. `scatter_to_primary` is the ratio of scattered to other photons at that mean:
/// -ln((e^-x + s) / (1 + s)), Beer and Lambert's law with an even background.
float WithScatter(float integral, float scatter_to_primary);

class Fluoroscopy final : public Effect, public ImageSource, public Observer {
 public:
  /// wire: the rod of all instruments. contrast: null for no dye. motions: the motions of the
  /// vessel. All outlive this. instruments: at least one.
  Fluoroscopy(const FluoroscopySettings& settings, const WireModel& wire, const Contrast* contrast,
              std::vector<const vessel::FieldMotion*> motions, std::vector<Instrument> instruments);

  ImageSource* image() override { return this; }
  Observer* observer() override { return this; }
  void Restart() override;
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;
  bool Take(const TickView& tick) override;
  bool Render(Picture& out) override;

  const FluoroscopySettings& settings() const { return settings_; }
  /// Mean attenuation of the last picture, which sets its exposure.
  float exposure() const { return exposure_; }

 private:
  using Mode = FluoroscopySettings::Mode;

  // Contents of a picture.
  struct Shot {
    std::int64_t session = 0;  // number of restarts before it
    std::int64_t number = 0;   // since the start
    std::int64_t pedal = 0;    // number of pedal presses before it
    double time_s = 0;
    Controls controls;
    Eigen::Vector3d organs_mm = Eigen::Vector3d::Zero();  // displacement of the organs
    // Each instrument, the outermost first; a hollow one is followed by its lumen, to be
    // subtracted.
    std::vector<std::vector<WirePoint>> shadows;
    bool has_dye = false;
    std::vector<float> dye_1_mm;           // at each lumen point
    std::vector<Eigen::Vector3f> offsets;  // of each lumen point, if the vessel moves
  };
  // Lumen points of one edge, and their positions in its cells.
  struct Branch {
    std::size_t first = 0;
    std::size_t count = 0;
  };
  struct CellPlace {
    std::size_t cell = 0;  // index; the next cell is used too
    float part = 0;        // weight of the next cell
  };

  void LayLumen();
  void TakeInstruments(const WireState& state, Shot& shot);
  void TakeDye(Shot& shot);
  Eigen::Vector3d OrgansNow() const;
  void FindBody(const Shot& shot);
  void PaintDye(const Shot& shot, const Projection& projection);
  void Subtract(const Shot& shot);
  void Expose(const Shot& shot, Picture& out) const;
  static void CoverWithShutters(const Imaging& imaging, Picture& out);
  Mode ModeOf(const Imaging& imaging) const;
  double PulsesPerS(const Imaging& imaging) const;
  CArm ArmOf(const Imaging& imaging) const;
  double PulseKermaMGy(const Controls& controls) const;
  double OpenAreaCm2(const Imaging& imaging) const;

  const FluoroscopySettings settings_;
  const WireModel& wire_;
  const Contrast* const contrast_;
  const std::vector<const vessel::FieldMotion*> motions_;
  const std::vector<Instrument> instruments_;
  std::vector<Branch> branches_;
  std::vector<LumenPoint> lumen_;
  std::vector<CellPlace> cell_places_;

  // Used by the tick thread.
  Latest<Shot> shots_;
  std::vector<Eigen::Vector3d> nodes_;
  std::vector<Eigen::Vector3f> offsets_;
  double next_s_ = 0;
  bool was_down_ = false;
  std::int64_t pedal_ = 0;
  std::int64_t session_ = 0;
  std::int64_t number_ = 0;
  std::int64_t pulses_ = 0;
  double next_pulse_s_ = 0;
  bool was_exposed_ = false;
  double air_kerma_mGy_ = 0;
  double kerma_area_Gy_cm2_ = 0;
  double pulse_mGy_ = 0;  // at the angles and the field below; 0: unknown
  double dose_lao_rad_ = 0, dose_cra_rad_ = 0, dose_magnification_ = 0;
  double field_mm_ = 0;  // width of the picture at the isocenter

  // Used by the render thread.
  LumenPainter painter_;
  std::vector<LumenPoint> painted_lumen_;
  Plane body_plane_, devices_, dye_, scratch_, mask_, mask_body_, densest_dye_;
  std::vector<float> noise_, mask_noise_;
  bool has_body_ = false;
  double body_lao_rad_ = 0, body_cra_rad_ = 0, body_magnification_ = 0;
  Eigen::Vector3d body_organs_mm_ = Eigen::Vector3d::Zero();
  bool has_mask_ = false;
  std::int64_t mask_pedal_ = 0;
  std::int64_t seen_session_ = 0;  // of the last picture
  float exposure_ = 0;
};

/// Makes it with the dye, the motions and the instruments of a scene.
std::unique_ptr<Fluoroscopy> MakeFluoroscopy(const FluoroscopySettings& settings,
                                             const EffectContext& context);

EffectKind FluoroscopyKind();

}  // namespace torquer::effects
