// The two joystick axes: conversions that run beside the sensor's burst, the position at rest, and
// the dead zone around it; now and then, in their place, the chip's supply.
#pragma once

#include <stdint.h>

#include "firmware/board/board.h"

namespace torquer {
namespace firmware {

/// One axis. A stick does not rest at half of its range: its rest is measured at the start,
/// reported as 512, and each side of it stretched to its end.
class JoystickAxis {
 public:
  static constexpr uint16_t kMiddle = 512;
  static constexpr uint16_t kFullScale = 1023;
  /// A rest farther from the middle, or readings that spread wider, are taken for a stick that is
  /// held: its middle then is 512.
  static constexpr uint16_t kLargestOffset = 120;
  static constexpr uint16_t kLargestSpread = 16;
  static constexpr uint8_t kRestReadings = 64;

  /// `head_start` readings are taken for done, so that two axes do not measure in the same frame.
  explicit JoystickAxis(uint8_t head_start) : readings_(head_start) {}

  /// A reading, 0 .. 1023. The first ones are thrown away, the next measure the rest.
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
  /// To be called before the first frame, and before the first after a suspension.
  void Start();
  /// Begins a frame: fetches y, converted since the end of the frame before, and begins x. In every
  /// 256th frame the supply takes the place of x, and of the y of the next frame.
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
