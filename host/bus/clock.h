// The clock behind every timestamp on a wire.
#pragma once

#include <cstdint>

namespace torquer::bus {

/// Now by CLOCK_MONOTONIC, us.
std::int64_t MonotonicUs();

/// Whose CLOCK_MONOTONIC that is: a positive 63-bit number made of the kernel's boot id. It is the
/// same for all processes since one boot of one machine; times are comparable only where it
/// agrees. Falls back to a random number (equal to nobody's) where the boot id cannot be read.
std::int64_t ClockId();

}  // namespace torquer::bus
