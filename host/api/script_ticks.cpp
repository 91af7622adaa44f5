#include "host/api/script_ticks.h"

#include <cmath>

namespace torquer {

bool ScriptTicks::Next(Command& tick) {
  if (done_) return false;
  tick = row_;
  // Tolerance, in steps, within which a row and a step end together.
  constexpr double kRounding = 1e-6;
  ++count_;
  const double until_s =
      (std::floor(before_.time_s / step_s_ + kRounding) + static_cast<double>(count_)) * step_s_;
  if (until_s > row_.time_s - kRounding * step_s_) {
    done_ = true;
    return true;
  }
  const double part = (until_s - before_.time_s) / (row_.time_s - before_.time_s);
  tick.time_s = until_s;
  for (std::size_t k = 0; k < tick.hands.size(); ++k) {
    const Hand& from = before_.hands[k];
    const Hand& to = row_.hands[k];
    tick.hands[k] = {std::lerp(from.insertion_mm, to.insertion_mm, part),
                     std::lerp(from.rotation_rad, to.rotation_rad, part)};
  }
  return true;
}

}  // namespace torquer
