#include "firmware/src/joystick.h"

#include "firmware/board/board.h"

namespace torquer {
namespace firmware {

uint16_t ApplyDeadzone(uint16_t value, uint16_t deadzone) {
  constexpr uint16_t kMiddle = 512;
  const uint16_t distance =
      static_cast<uint16_t>(value > kMiddle ? value - kMiddle : kMiddle - value);
  return distance <= deadzone ? kMiddle : value;
}

void Joystick::Start() { board::BeginAdc(board::Axis::kY); }

void Joystick::BeginFrame() {
  y_ = board::FinishAdc();
  board::BeginAdc(board::Axis::kX);
}

void Joystick::EndFrame() {
  x_ = board::FinishAdc();
  board::BeginAdc(board::Axis::kY);
}

}  // namespace firmware
}  // namespace torquer
