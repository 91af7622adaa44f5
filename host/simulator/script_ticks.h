// A row of a script, cut into ticks.
#pragma once

#include <cstdint>

#include "host/api/torquer/torquer.h"

namespace torquer::simulator {

/// The ticks from one row of a script to the next: they end at the multiples of a step of time
/// since the start, and at the row, so that they do not depend on how a motion is cut into rows.
/// The hands move evenly from row to row; all else is as the row has it.
class ScriptTicks {
 public:
  /// `row` is after `before`, times since the start, and has the same instruments. `step_s` > 0;
  /// infinite: the row is one tick.
  ScriptTicks(const torquer::Command& before, const torquer::Command& row, double step_s)
      : before_(before), row_(row), step_s_(step_s) {}
  /// The next of them; false after the one that ends with the row.
  bool Next(torquer::Command& tick);
  /// Whether the one that ends with the row was the last.
  bool done() const { return done_; }

 private:
  const torquer::Command& before_;
  const torquer::Command& row_;
  const double step_s_;
  bool done_ = false;
  std::int64_t count_ = 0;
};

}  // namespace torquer::simulator
