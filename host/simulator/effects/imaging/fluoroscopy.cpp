#include "host/simulator/effects/imaging/fluoroscopy.h"

#include <utility>

namespace torquer::effects {

Fluoroscopy::Fluoroscopy(const FluoroscopySettings& settings, const WireModel& wire,
                         const Contrast* contrast, std::vector<const vessel::FieldMotion*> motions,
                         std::vector<Instrument> instruments)
    : settings_(settings),
      dye_points_(LayDyePoints(contrast)),
      taker_(settings_, wire, contrast, dye_points_, std::move(motions), std::move(instruments)),
      renderer_(settings_, dye_points_) {}

void Fluoroscopy::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Fluoroscopy&>(twin);
  dose_ = from.dose_;
  table_ = from.table_;
  mask_view_ = from.mask_view_;
  mask_lost_s_ = from.mask_lost_s_;
  newest_ = from.newest_;
  taker_.CopyFrom(from.taker_);
  renderer_.CopyFrom(from.renderer_);
  frames_.CopyFrom(from.frames_);
}

void Fluoroscopy::Restart() {
  dose_ = DoseMeter();
  table_ = {};
  mask_view_ = {};
  mask_lost_s_.reset();
  newest_ = {};
  taker_.Restart();
}

void Fluoroscopy::Observe(const TickView& tick) {
  dose_.Observe(settings_, tick.time_s, tick.controls);
  table_ = tick.controls.table;
  const View view = ViewOf(tick.controls);
  if (mask_view_.magnification > 0 && mask_view_ != view) {
    mask_view_ = {};
    mask_lost_s_ = tick.time_s;
  }
  const bool has_mask = FluoroscopySettings::HasMask(settings_.ModeOf(tick.controls.imaging));
  if (tick.controls.xray && has_mask) mask_view_ = view;
}

std::vector<Reading> Fluoroscopy::Readings() const {
  std::vector<Reading> readings = DoseReadings();
  readings.push_back({"table_left_mm", table_.left_mm});
  readings.push_back({"table_head_mm", table_.head_mm});
  readings.push_back({"table_height_mm", table_.height_mm});
  readings.push_back({"mask_lost_s", mask_lost_s_.value_or(Newest::kUnknown)});
  readings.push_back({"picture_mode", newest_.mode});
  readings.push_back({"picture_instrument", newest_.instrument});
  readings.push_back({"picture_contrast", newest_.contrast});
  return readings;
}

bool Fluoroscopy::Take(const TickView& tick) {
  XrayFrame& frame = frames_.Draft();
  if (!taker_.Take(tick, frame)) return false;
  const PictureContents contents = ContentsOf(frame, dye_points_, settings_);
  newest_ = {.mode = static_cast<double>(settings_.ModeOf(frame.controls.imaging)),
             .instrument = contents.instrument ? 1.0 : 0.0,
             .contrast = contents.contrast ? 1.0 : 0.0};
  frames_.Publish();
  return true;
}

bool Fluoroscopy::Render(Picture& out) {
  const bool is_new = frames_.Fetch();
  renderer_.Render(frames_.Held(), out);
  return is_new;
}

}  // namespace torquer::effects
