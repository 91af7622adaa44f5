// Status bits of a state.
#pragma once

#include <cstdint>

#include "protocol/lcm_channels.h"

namespace torquer::simulator {

/// Bits of WireStatus for the report of a tick: that of a relaxation, or of torquer.h.
template <class Report>
std::int32_t StatusBits(const Report& report, bool outside_lumen) {
  return (report.converged ? protocol::kWireConverged : 0) |
         (report.budget_spent ? protocol::kWireBudgetSpent : 0) |
         (outside_lumen ? protocol::kWireOutsideLumen : 0) |
         (report.snapped ? protocol::kWireSnapped : 0) |
         (report.stalled ? protocol::kWireStalled : 0);
}

}  // namespace torquer::simulator
