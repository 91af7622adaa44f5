// Commands for the table, from the positions that the joystick gives it. No clock.
#pragma once

#include <cstdint>
#include <string>

#include "host/bus/bus.h"
#include "host/daemon/hand_tracker.h"
#include "torquer_lcm/table_command_t.hpp"

namespace torquer::daemon {

/// Limits the commands to one in kIntervalUs while the table moves, and one in kRepeatUs at rest. A
/// table that has not moved yet gets none.
class TableCommands {
 public:
  static constexpr std::int64_t kIntervalUs = 8000;
  static constexpr std::int64_t kRepeatUs = 100000;

  /// The command to send at `now_us`, by bus::MonotonicUs(), for a position; null for none.
  const torquer_lcm::table_command_t* Next(const TablePlace& place, std::int64_t now_us,
                                           const std::string& instrument);
  /// Publishes it.
  void Publish(const TablePlace& place, std::int64_t now_us, const std::string& instrument,
               bus::Bus& bus);

 private:
  torquer_lcm::table_command_t command_{};
  TablePlace sent_;
  bool moved_ = false;
};

}  // namespace torquer::daemon
