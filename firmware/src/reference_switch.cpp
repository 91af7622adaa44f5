#include "firmware/src/reference_switch.h"

#include "firmware/src/buttons.h"

namespace torquer {
namespace firmware {
namespace {

// Number of readings without contact after which the next contact is a new touch, not a bounce.
constexpr uint8_t kQuietReadings = Buttons::kStableReadings;

}  // namespace

void ReferenceSwitch::Update(bool contact, bool closed, int32_t axial_counts) {
  if (contact && !closed && open_readings_ == kQuietReadings) {
    touched_at_ = axial_counts;
    touch_seen_ = true;
  }
  if (contact) {
    open_readings_ = 0;
  } else if (open_readings_ < kQuietReadings) {
    ++open_readings_;
  }
  // A switch that was closed at the start gives no position of the closing.
  if (closed && !closed_ && touch_seen_) {
    counts_ = touched_at_;
    passed_ = true;
  }
  closed_ = closed;
}

void ReferenceSwitch::Shift(int32_t counts) {
  counts_ =
      passed_ ? static_cast<int32_t>(static_cast<uint32_t>(counts_) - static_cast<uint32_t>(counts))
              : 0;
  touched_at_ =
      static_cast<int32_t>(static_cast<uint32_t>(touched_at_) - static_cast<uint32_t>(counts));
}

}  // namespace firmware
}  // namespace torquer
