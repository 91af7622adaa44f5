#include "firmware/src/buttons.h"

namespace torquer {
namespace firmware {

uint8_t Buttons::Update(uint8_t pins, uint8_t stable_readings) {
  if (pins == held_ && !counting_) return held_;
  counting_ = pins != held_;
  for (uint8_t i = 0; i < kCount; ++i) {
    const uint8_t bit = static_cast<uint8_t>(1 << i);
    if (((pins ^ held_) & bit) == 0) {
      differing_[i] = 0;
    } else if (++differing_[i] >= stable_readings) {
      held_ ^= bit;
      differing_[i] = 0;
    }
  }
  return held_;
}

}  // namespace firmware
}  // namespace torquer
