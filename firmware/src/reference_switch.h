// The end switch, an optional part: where the count stood when the cylinder closed it.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

class ReferenceSwitch {
 public:
  /// A frame: whether the contact is closed now, bounces included; whether it is after debouncing;
  /// and the count. What holds is the count of the first touch, not of the end of the bounces.
  void Update(bool contact, bool closed, int32_t axial_counts);
  /// The count has been set back by so much.
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
