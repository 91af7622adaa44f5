// X-ray picture: a C-arm about the patient, the wire, dye in the vessels and a body around them.
// Its quantum noise follows from the dose.
//
//   tick thread: FrameTaker --nodes, dye--> newest frame --> render thread: PictureRenderer
//                DoseMeter
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "host/simulator/effects/blood/contrast.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/imaging/dose_meter.h"
#include "host/simulator/effects/imaging/fluoroscopy_settings.h"
#include "host/simulator/effects/imaging/frame_taker.h"
#include "host/simulator/effects/imaging/latest.h"
#include "host/simulator/effects/imaging/picture_renderer.h"

namespace torquer::effects {

class Fluoroscopy final : public Effect, public ImageSource, public Observer {
 public:
  /// wire: the empty rod of the innermost curve. contrast: null for no dye. motions: the motions of
  /// the vessel. All outlive this. instruments: at least one.
  Fluoroscopy(const FluoroscopySettings& settings, const WireModel& wire, const Contrast* contrast,
              std::vector<const vessel::FieldMotion*> motions, std::vector<Instrument> instruments);

  ImageSource* image() override { return this; }
  Observer* observer() override { return this; }
  std::uint64_t FileHash() const override {
    return settings_.scan != nullptr ? settings_.scan->file_hash() : 0;
  }
  void Restart() override;
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;
  /// The part of the readings that each plane of a biplane system has.
  std::vector<Reading> DoseReadings() const { return dose_.Readings(settings_); }
  bool Take(const TickView& tick) override;
  bool Render(Picture& out) override;

  const FluoroscopySettings& settings() const { return settings_; }
  /// Mean attenuation of the last picture, which sets its exposure.
  float exposure() const { return renderer_.exposure(); }

 private:
  // The picture taken last. NaN: none.
  struct Newest {
    double mode = kUnknown;
    double instrument = kUnknown;
    double contrast = kUnknown;
    static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  };

  const FluoroscopySettings settings_;
  const DyePoints dye_points_;
  DoseMeter dose_;
  Table table_;                        // of the last tick
  View mask_view_;                     // of the mask; no view without a mask
  std::optional<double> mask_lost_s_;  // newest time at which a mask was lost
  Newest newest_;
  FrameTaker taker_;
  Latest<XrayFrame> frames_;
  PictureRenderer renderer_;  // used by the render thread
};

/// Makes it with the dye, the motions and the instruments of a scene.
std::unique_ptr<Fluoroscopy> MakeFluoroscopy(const FluoroscopySettings& settings,
                                             const EffectContext& context);

EffectKind FluoroscopyKind();

}  // namespace torquer::effects
