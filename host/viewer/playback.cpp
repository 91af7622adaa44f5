#include "host/viewer/playback.h"

#include <algorithm>
#include <cmath>

namespace torquer::viewer {

Playback::Playback(std::int64_t length_us, const std::vector<std::int64_t>& state_times_us)
    : length_us_(length_us), state_times_us_(state_times_us), at_us_(state_times_us.front()) {}

void Playback::Advance(std::int64_t now_us) {
  const std::int64_t passed_us = started_ ? now_us - now_us_ : 0;
  started_ = true;
  now_us_ = now_us;
  if (!playing_) return;
  const double way_us = rest_us_ + speed_ * static_cast<double>(passed_us);
  const double whole_us = std::floor(way_us);
  rest_us_ = way_us - whole_us;
  at_us_ += static_cast<std::int64_t>(whole_us);
  if (at_us_ < length_us_) return;
  at_us_ = length_us_;
  playing_ = false;
}

void Playback::Take(const ReplayControls& controls) {
  speed_ = controls.speed;
  if (controls.at_s) {
    const double length_s = 1e-6 * static_cast<double>(length_us_);
    at_us_ = std::llround(1e6 * std::min(*controls.at_s, length_s));
    rest_us_ = 0;
  }
  if (controls.steps != 0) Step(controls.steps);
  const bool from_the_end = controls.play && !playing_ && !controls.at_s && at_us_ == length_us_;
  if (from_the_end) at_us_ = state_times_us_.front();
  playing_ = controls.play;
}

// Moves by a number of states, at most to the first or the last one. States of the same time count
// once.
void Playback::Step(int states) {
  const auto& times = state_times_us_;
  for (; states > 0; --states) {
    const auto next = std::upper_bound(times.begin(), times.end(), at_us_);
    if (next == times.end()) break;
    at_us_ = *next;
  }
  for (; states < 0; ++states) {
    // The newest state until now is shown; this finds the one before it.
    const auto shown = std::upper_bound(times.begin(), times.end(), at_us_);
    if (shown == times.begin()) break;
    const auto first = std::lower_bound(times.begin(), shown, *(shown - 1));
    if (first == times.begin()) break;
    at_us_ = *(first - 1);
  }
  rest_us_ = 0;
}

}  // namespace torquer::viewer
