#include "firmware/src/joystick.h"

#include "firmware/board/board.h"

namespace torquer {
namespace firmware {
namespace {

constexpr uint8_t kGainBits = 15;

uint16_t Gain(uint16_t reported, uint16_t read) {
  return static_cast<uint16_t>((static_cast<uint32_t>(reported) << kGainBits) / read);
}

// Rounds to the nearest; the shift by 16 bits takes no instruction.
uint16_t Stretch(uint16_t distance, uint16_t gain) {
  const uint32_t twice = (static_cast<uint32_t>(distance) * gain) << 1;
  return static_cast<uint16_t>((twice + 0x8000) >> 16);
}

}  // namespace

void JoystickAxis::Take(uint16_t value) {
  value_ = value;
  constexpr uint8_t kLast = kUnsettledReadings + kRestReadings;
  if (readings_ > kLast + 1) return;
  if (++readings_ <= kUnsettledReadings) return;
  if (readings_ <= kLast) {
    sum_ = static_cast<uint16_t>(sum_ + value);
    if (value < lowest_) lowest_ = value;
    if (value > highest_) highest_ = value;
    if (readings_ == kLast) FindRest();
    return;
  }
  // A division a frame.
  if (readings_ == kLast + 1) {
    gain_up_ = Gain(kFullScale - kMiddle, static_cast<uint16_t>(kFullScale - rest_));
  } else {
    gain_down_ = Gain(kMiddle, rest_);
  }
}

void JoystickAxis::FindRest() {
  const uint16_t mean = static_cast<uint16_t>((sum_ + kRestReadings / 2) / kRestReadings);
  if (highest_ - lowest_ > kLargestSpread) return;
  if (mean > kMiddle + kLargestOffset || mean < kMiddle - kLargestOffset) return;
  rest_ = mean;
}

uint16_t JoystickAxis::Report(uint16_t deadzone) const {
  const bool up = value_ > rest_;
  const uint16_t distance = static_cast<uint16_t>(up ? value_ - rest_ : rest_ - value_);
  if (distance <= deadzone) return kMiddle;
  return static_cast<uint16_t>(up ? kMiddle + Stretch(distance, gain_up_)
                                  : kMiddle - Stretch(distance, gain_down_));
}

void Joystick::Start() { Begin(board::Analog::kJoystickY); }

void Joystick::Begin(board::Analog input) {
  converting_ = input;
  board::BeginAdc(input);
}

void Joystick::BeginFrame() {
  const uint16_t reading = board::FinishAdc();
  if (converting_ == board::Analog::kJoystickY) {
    y_.Take(reading);
  } else {
    band_gap_ = reading;
  }
  const bool measure_supply = ++frames_ == 0;
  Begin(measure_supply ? board::Analog::kBandGap : board::Analog::kJoystickX);
}

void Joystick::EndFrame() {
  const uint16_t reading = board::FinishAdc();
  if (converting_ == board::Analog::kBandGap) {  // not settled: once more
    Begin(board::Analog::kBandGap);
    return;
  }
  x_.Take(reading);
  Begin(board::Analog::kJoystickY);
}

uint16_t Joystick::supply_mv() const {
  // 16 bits suffice for steps of kStep_mv. A division of 32 bits would take a tenth of a frame.
  constexpr uint16_t kStep_mv = 20;
  constexpr uint16_t kSteps =
      static_cast<uint16_t>(static_cast<uint32_t>(board::kBandGap_mv) * 1024 / kStep_mv);
  return band_gap_ == 0 ? 0 : static_cast<uint16_t>(kSteps / band_gap_ * kStep_mv);
}

}  // namespace firmware
}  // namespace torquer
