#include "host/recorder/shape_thinner.h"

#include <cmath>

#include "host/bus/message_check.h"
#include "host/bus/state_outline.h"
#include "host/support/event_log.h"

namespace torquer {

ShapeThinner::ShapeThinner(double shapes_hz) : period_us_(std::llround(1e6 / shapes_hz)) {}

std::span<const std::uint8_t> ShapeThinner::Take(std::span<const std::uint8_t> message,
                                                 std::int64_t time_us) {
  owed_.clear();
  if (!bus::DecodeMessage(message.data(), message.size(), state_)) return message;
  // Tick numbers from a bus are untrusted: the comparison before the subtraction prevents overflow.
  const bool follows = last_tick_ && last_tick_ < state_.tick && state_.tick - 1 == *last_tick_;
  const bool repeated = last_tick_ == state_.tick;
  last_tick_ = state_.tick;
  if (!last_shape_us_ || ElapsedUs(*last_shape_us_, time_us) >= period_us_) {
    last_shape_us_ = time_us;
    last_past_tick_ = state_.tick;
    return message;
  }
  bus::ReduceToOutline(state_);
  if (repeated || (follows && state_.tick - last_past_tick_ < kPastTicks)) {
    bus::DropPast(state_);
  } else {
    last_past_tick_ = state_.tick;
  }
  owed_.assign(message.begin(), message.end());
  outline_.resize(static_cast<std::size_t>(state_.getEncodedSize()));
  state_.encode(outline_.data(), 0, static_cast<int>(outline_.size()));
  return outline_;
}

}  // namespace torquer
