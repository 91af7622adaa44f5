// Shape thinner: reduces how often wire states in a log carry a shape.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "torquer_lcm/wire_state_t.hpp"

namespace torquer {

/// Between two shapes, states are reduced to outlines (host/bus/state_outline.h). Outlines have all
/// data for a replay and a motion report. Data about past ticks in a state is already in the log,
/// so it is dropped. It is kept with shapes, after a gap, and every kPastTicks. A replay can thus
/// recover from damage to the log.
class ShapeThinner {
 public:
  static constexpr std::int64_t kPastTicks = 16;

  /// `shapes_hz`: maximum number of shapes per second, > 0.
  explicit ShapeThinner(double shapes_hz);

  /// Returns the bytes to write for a message of the wire state channel that arrived at `time_us`.
  /// They are valid until the next call. An undecodable message is returned unchanged.
  std::span<const std::uint8_t> Take(std::span<const std::uint8_t> message, std::int64_t time_us);

  /// Makes the next state keep its shape.
  void WantShape() { last_shape_us_.reset(); }

  /// Newest state with its shape if the log has only its outline, else empty. The recorder writes
  /// it last, so that a log ends with a shape.
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
