// Clocks: the source of every timestamp in a message.
#pragma once

#include <cstdint>

namespace torquer::bus {

/// Now by CLOCK_MONOTONIC, us.
std::int64_t MonotonicUs();

/// Now by CLOCK_BOOTTIME, us; it continues while the machine sleeps. For computing ages, not for
/// messages.
std::int64_t BoottimeUs();

/// Identity of MonotonicUs()'s clock, by machine and boot. It is a positive 63-bit hash of the
/// kernel's boot id, the same in all processes. Times can be compared only if their clock ids are
/// equal. If the boot id cannot be read, the id is a random number, which matches no other.
std::int64_t ClockId();

}  // namespace torquer::bus
