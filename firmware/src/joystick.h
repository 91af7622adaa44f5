// The two joystick axes: their conversions, position at rest and dead zone. Conversions run during
// the sensor's burst. In every 256th frame the chip's supply is measured instead.
#pragma once

#include <stdint.h>

#include "firmware/board/board.h"

namespace torquer {
namespace firmware {

/// One axis. The rest of a stick is not the middle of its range. So the rest is measured at the
/// start and reported as 512, and each side is scaled to its end.
class JoystickAxis {
 public:
  static constexpr uint16_t kMiddle = 512;
  static constexpr uint16_t kFullScale = 1023;
  /// If the rest is farther from the middle, or if the readings spread wider, the stick counts as
  /// held. Its middle is then 512.
  static constexpr uint16_t kLargestOffset = 120;
  static constexpr uint16_t kLargestSpread = 16;
  static constexpr uint8_t kRestReadings = 64;

  /// `head_start` readings count as done, so that two axes do not measure in the same frame.
  explicit JoystickAxis(uint8_t head_start) : readings_(head_start) {}

  /// Takes a reading, 0 .. 1023. The first readings are discarded, the next ones measure the rest.
  void Take(uint16_t value);
  /// The reading as reported: 512 within `deadzone` counts of the rest, 0 and 1023 at the ends.
  uint16_t Report(uint16_t deadzone) const;
  /// The reading at rest; 512 before it is measured, and if it could not be.
  uint16_t rest() const { return rest_; }

 private:
  static constexpr uint8_t kUnsettledReadings = 32;

  void FindRest();

  uint16_t value_ = kMiddle;
  uint16_t rest_ = kMiddle;
  uint16_t sum_ = 0;
  uint16_t lowest_ = kFullScale;
  uint16_t highest_ = 0;
  uint16_t gain_up_ = uint16_t{1} << 15;  // of each side, in 1 / 32768
  uint16_t gain_down_ = uint16_t{1} << 15;
  uint8_t readings_;
};

class Joystick {
 public:
  /// Call before the first frame, and before the first frame after a suspension.
  void Start();
  /// Begins a frame: fetches y, whose conversion began in the previous frame, and begins x. In
  /// every 256th frame the supply replaces x and the y of the next frame.
  void BeginFrame();
  /// Fetches x and begins the y of the next frame.
  void EndFrame();

  const JoystickAxis& x() const { return x_; }
  const JoystickAxis& y() const { return y_; }
  /// The chip's supply in mV, +-10 %, in steps of 20 mV; 0 before it is measured.
  uint16_t supply_mv() const;

 private:
  void Begin(board::Analog input);

  JoystickAxis x_{0};
  JoystickAxis y_{8};
  uint16_t band_gap_ = 0;  // latest reading
  uint8_t frames_ = 0;     // wraps
  board::Analog converting_ = board::Analog::kJoystickY;
};

}  // namespace firmware
}  // namespace torquer
