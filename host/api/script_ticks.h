// Divides a row of a script into ticks.
#pragma once

#include <cstdint>

#include "host/api/torquer/torquer.h"

namespace torquer {

/// Ticks from one row of a script to the next. They end at the multiples of a time step since the
/// start, and at the row. The multiples do not depend on the division of a motion into rows. The
/// hands move linearly from row to row; all other values are those of the row.
class ScriptTicks {
 public:
  /// `row` is later than `before`, with times since the start, and has the same instruments.
  /// `step_s` > 0; infinite: the row is one tick.
  ScriptTicks(const Command& before, const Command& row, double step_s)
      : before_(before), row_(row), step_s_(step_s) {}
  /// Sets the next tick; returns false after the last tick of the row.
  bool Next(Command& tick);
  /// True after the tick that ends with the row.
  bool done() const { return done_; }

 private:
  const Command& before_;
  const Command& row_;
  const double step_s_;
  bool done_ = false;
  std::int64_t count_ = 0;
};

}  // namespace torquer
