#include "host/support/realtime.h"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <atomic>
#include <string>

#include "host/support/error.h"

namespace torquer {

namespace {

// Lower than the kernel's threads for interrupts, which bring the device's reports.
constexpr int kPriority = 20;

std::atomic<bool> entered = false;

rlim_t LimitOf(__rlimit_resource resource) {
  rlimit limit{};
  getrlimit(resource, &limit);
  return limit.rlim_cur;
}

[[noreturn]] void RefuseLimit(const std::string& why, const std::string& line) {
  throw UserError(
      fmt::format("--realtime: {}; as root, write the line '{}' for this user into "
                  "/etc/security/limits.d/torquer.conf and log in again (host/daemon/README.md has "
                  "the same for "
                  "a service)",
                  why, line));
}

// True if any amount of memory may be locked. With a limit, later allocations would be refused.
bool LocksAnything() {
  const rlim_t limit = LimitOf(RLIMIT_MEMLOCK);
  if (limit == RLIM_INFINITY) return true;
  // The probe exceeds the limit: it succeeds only if the limit does not apply. It is never touched.
  void* const probe = mmap(nullptr, limit + 4096, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (probe == MAP_FAILED) return false;
  munmap(probe, limit + 4096);
  return true;
}

}  // namespace

void EnterRealtime() {
  const bool locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  if (!locked || !LocksAnything()) {
    if (locked) munlockall();
    RefuseLimit(fmt::format("this user may lock only {} bytes of memory", LimitOf(RLIMIT_MEMLOCK)),
                "USER - memlock unlimited");
  }
  const sched_param priority{.sched_priority = kPriority};
  if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority) != 0) {
    munlockall();
    RefuseLimit(fmt::format("this user may have real-time priorities up to {}, but {} is needed",
                            LimitOf(RLIMIT_RTPRIO), kPriority),
                fmt::format("USER - rtprio {}", kPriority));
  }
  entered = true;
}

void LeaveRealtime() noexcept {
  if (!entered) return;
  const sched_param ordinary{};
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);
}

}  // namespace torquer
