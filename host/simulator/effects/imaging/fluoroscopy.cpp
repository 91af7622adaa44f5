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
  taker_.CopyFrom(from.taker_);
  renderer_.CopyFrom(from.renderer_);
  frames_.CopyFrom(from.frames_);
}

void Fluoroscopy::Restart() {
  dose_ = DoseMeter();
  taker_.Restart();
}

void Fluoroscopy::Observe(const TickView& tick) {
  dose_.Observe(settings_, tick.time_s, tick.controls);
}

std::vector<Reading> Fluoroscopy::Readings() const { return dose_.Readings(settings_); }

bool Fluoroscopy::Take(const TickView& tick) {
  if (!taker_.Take(tick, frames_.Draft())) return false;
  frames_.Publish();
  return true;
}

bool Fluoroscopy::Render(Picture& out) {
  const bool is_new = frames_.Fetch();
  renderer_.Render(frames_.Held(), out);
  return is_new;
}

}  // namespace torquer::effects
