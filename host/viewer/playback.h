// Position and speed of a replay. No clock, no I/O.
#pragma once

#include <cstdint>
#include <vector>

#include "host/viewer/page_messages.h"

namespace torquer::viewer {

class Playback {
 public:
  /// Plays a recording of `length_us` from its first wire state. `state_times_us`: times of the
  /// states, at least one, not decreasing; must outlive this.
  Playback(std::int64_t length_us, const std::vector<std::int64_t>& state_times_us);

  /// Advances by the time since the last call, times the speed; stops at the end.
  void Advance(std::int64_t now_us);
  /// At the end, playing begins again.
  void Take(const ReplayControls& controls);

  std::int64_t at_us() const { return at_us_; }
  bool playing() const { return playing_; }
  double speed() const { return speed_; }

 private:
  void Step(int states);

  const std::int64_t length_us_;
  const std::vector<std::int64_t>& state_times_us_;
  std::int64_t at_us_;
  double rest_us_ = 0;  // less than 1, still to go
  std::int64_t now_us_ = 0;
  bool started_ = false;
  bool playing_ = true;
  double speed_ = 1;
};

}  // namespace torquer::viewer
