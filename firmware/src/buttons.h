// Buttons without their bounces.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

class Buttons {
 public:
  /// Readings in a row, one a millisecond, that must agree before a change counts.
  static constexpr uint8_t kStableReadings = 5;

  /// Takes one reading of the pins (protocol::Button bits); returns what is held, debounced.
  uint8_t Update(uint8_t pins);
  /// What Update() returned last.
  uint8_t held() const { return held_; }

 private:
  static constexpr uint8_t kCount = 3;
  uint8_t held_ = 0;
  uint8_t differing_[kCount] = {};  // readings in a row that differ from held_
};

}  // namespace firmware
}  // namespace torquer
