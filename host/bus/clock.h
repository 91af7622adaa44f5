// The clock of every timestamp in a message.
#pragma once

#include <cstdint>

namespace torquer::bus {

/// Now by CLOCK_MONOTONIC, us.
std::int64_t MonotonicUs();

/// Now by CLOCK_BOOTTIME, us: goes on while the machine sleeps. For ages, not for messages.
std::int64_t BoottimeUs();

/// Which machine's CLOCK_MONOTONIC that is, since which boot: a positive 63-bit number made of the
/// kernel's boot id, the same for all its processes. Times can be compared only where it agrees.
/// Where the boot id cannot be read it is a random number, which agrees with no other.
std::int64_t ClockId();

}  // namespace torquer::bus
