// Wire states on their way into a log that has shapes less often than ticks.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "torquer_lcm/wire_state_t.hpp"

namespace torquer {

/// Between two shapes states become outlines (host/bus/state_outline.h), which have all that a
/// replay and a report of motion need. What a state says of the ticks before it is in the log
/// already; it stays with the shapes, after a gap, and every kPastTicks, so that a replay gets over
/// damage to the log.
class ShapeThinner {
 public:
  static constexpr std::int64_t kPastTicks = 16;

  /// At most so many shapes a second, > 0.
  explicit ShapeThinner(double shapes_hz);

  /// What is to be written for a message of the channel of wire states, which came at `time_us`;
  /// valid until the next call. What is no wire state is written as it came.
  std::span<const std::uint8_t> Take(std::span<const std::uint8_t> message, std::int64_t time_us);

  /// The next state has its shape.
  void WantShape() { last_shape_us_.reset(); }

  /// The newest state as it came, where the log has it as an outline: a log ends with a shape.
  std::span<const std::uint8_t> Owed() const { return owed_; }

 private:
  const std::int64_t period_us_;
  std::optional<std::int64_t> last_shape_us_;
  std::optional<std::int64_t> last_tick_;
  std::int64_t last_past_tick_ = 0;
  torquer_lcm::wire_state_t state_{};
  std::vector<std::uint8_t> outline_;
  std::vector<std::uint8_t> owed_;
};

}  // namespace torquer
