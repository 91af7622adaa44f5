// Contacts without their bounces.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

class Buttons {
 public:
  /// Readings in a row that must agree before a change counts: one a millisecond while the bus is
  /// awake, which a foot switch's bounces do not reach; one every 32 ms while it is suspended.
  static constexpr uint8_t kStableReadings = 10;
  static constexpr uint8_t kStableReadingsSuspended = 2;

  /// Takes one reading of the pins (board::ReadButtons()); returns what is held, debounced.
  uint8_t Update(uint8_t pins, uint8_t stable_readings = kStableReadings);
  /// The last return value of Update().
  uint8_t held() const { return held_; }

 private:
  static constexpr uint8_t kCount = 4;
  uint8_t held_ = 0;
  bool counting_ = false;           // a reading has differed, and not all have agreed since
  uint8_t differing_[kCount] = {};  // readings in a row that differ from held_
};

}  // namespace firmware
}  // namespace torquer
