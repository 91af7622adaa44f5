#include "host/bus/clock.h"

#include <time.h>

#include <fstream>
#include <random>
#include <string>

#include "host/support/fnv1a.h"

namespace torquer::bus {
namespace {

std::int64_t NowUs(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1000000 + now.tv_nsec / 1000;
}

std::int64_t MakeClockId() {
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  std::string boot_id;
  std::uint64_t id;
  if (file >> boot_id) {
    id = Fnv1a(boot_id);
  } else {
    std::random_device entropy;
    id = (static_cast<std::uint64_t>(entropy()) << 32) | entropy();
  }
  id &= 0x7fffffffffffffff;
  return id == 0 ? 1 : static_cast<std::int64_t>(id);
}

}  // namespace

std::int64_t MonotonicUs() { return NowUs(CLOCK_MONOTONIC); }

std::int64_t BoottimeUs() { return NowUs(CLOCK_BOOTTIME); }

std::int64_t ClockId() {
  static const std::int64_t id = MakeClockId();
  return id;
}

}  // namespace torquer::bus
