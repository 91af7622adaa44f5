// Position and speed of a replay. No clock, no I/O.
#pragma once

#include <cstdint>
#include <vector>

#include "host/viewer/page_messages.h"

namespace torquer::viewer {

class Playback {
 public:
  /// A recording of length_us with wire states at the moments state_times_us, which rise or stay;
  /// at least one, and they outlive this. Plays from the first of them.
  Playback(std::int64_t length_us, const std::vector<std::int64_t>& state_times_us);

  /// Goes on by the time that has passed since the last call, times the speed; stops at the end.
  void Advance(std::int64_t now_us);
  /// Whoever plays at the end begins again.
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
