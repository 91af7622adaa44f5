// The two joystick axes: conversions that run beside the sensor's burst, and the dead zone.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

/// `value` (0 .. 1023), or 512 where it lies within `deadzone` counts of it.
uint16_t ApplyDeadzone(uint16_t value, uint16_t deadzone);

class Joystick {
 public:
  /// To be called once, before the first frame.
  void Start();
  /// Begins a frame: fetches y, converted since the end of the frame before, and begins x.
  void BeginFrame();
  /// Fetches x and begins the y of the next frame.
  void EndFrame();

  uint16_t x(uint16_t deadzone) const { return ApplyDeadzone(x_, deadzone); }
  uint16_t y(uint16_t deadzone) const { return ApplyDeadzone(y_, deadzone); }

 private:
  uint16_t x_ = 512;
  uint16_t y_ = 512;
};

}  // namespace firmware
}  // namespace torquer
