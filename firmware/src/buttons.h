// Contacts without their bounces.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

class Buttons {
 public:
  /// Equal consecutive readings before a change counts. A reading takes place every millisecond,
  /// and every 32 ms while the bus is suspended. The bounces of a foot switch are shorter than
  /// these readings.
  static constexpr uint8_t kStableReadings = 10;
  static constexpr uint8_t kStableReadingsSuspended = 2;

  /// Takes one reading of the pins (board::ReadButtons()); returns the held buttons, debounced.
  uint8_t Update(uint8_t pins, uint8_t stable_readings = kStableReadings);
  /// The last return value of Update().
  uint8_t held() const { return held_; }

 private:
  static constexpr uint8_t kCount = 5;
  uint8_t held_ = 0;
  bool counting_ = false;           // a reading has differed, and the change is not confirmed yet
  uint8_t differing_[kCount] = {};  // readings in a row that differ from held_
};

}  // namespace firmware
}  // namespace torquer
