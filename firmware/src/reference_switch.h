// End switch, an optional part: keeps the count at which the cylinder closed the switch.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

class ReferenceSwitch {
 public:
  /// Call once a frame with the raw contact, the debounced contact, and the count. The count of the
  /// first touch is kept, not the count after the bounces.
  void Update(bool contact, bool closed, int32_t axial_counts);
  /// Subtracts a change of the count from the kept count.
  void Shift(int32_t counts);

  bool passed() const { return passed_; }
  bool closed() const { return closed_; }
  /// The count at the latest closing; 0 before.
  int32_t counts() const { return counts_; }

 private:
  int32_t counts_ = 0;
  int32_t touched_at_ = 0;
  uint8_t open_readings_ = 0;  // in a row; stops at kQuietReadings
  bool touch_seen_ = false;
  bool passed_ = false;
  bool closed_ = false;
};

}  // namespace firmware
}  // namespace torquer
