// Real-time scheduling: granted if the limits allow it, otherwise refused entirely.
#include "host/support/realtime.h"

#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <thread>

#include "host/support/error.h"

namespace {

std::string StatusLine(const std::string& name) {
  std::ifstream in("/proc/self/status");
  for (std::string line; std::getline(in, line);) {
    if (line.rfind(name, 0) == 0) return line;
  }
  return "";
}

bool KeepsMemory() { return StatusLine("VmLck:").find(" 0 kB") == std::string::npos; }

int PolicyInThread(const std::function<void()>& first) {
  int policy = -1;
  std::thread([&] {
    first();
    policy = sched_getscheduler(0);
  }).join();
  return policy;
}

// Result of `work` in a child process, whose limits and scheduling end with it.
std::string InProcess(const std::function<std::string()>& work) {
  int ends[2];
  REQUIRE(pipe(ends) == 0);
  const pid_t child = fork();
  if (child == 0) {
    std::string said;
    try {
      said = work();
    } catch (const torquer::UserError& error) {
      said = error.what();
    }
    const bool whole =
        write(ends[1], said.data(), said.size()) == static_cast<ssize_t>(said.size());
    _exit(whole ? 0 : 1);
  }
  close(ends[1]);
  std::string said(4096, 0);
  const ssize_t bytes = read(ends[0], said.data(), said.size());
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  CHECK(status == 0);
  said.resize(bytes < 0 ? 0 : static_cast<std::size_t>(bytes));
  return said;
}

// Limits bind only processes without privileges.
void BecomeNobody() {
  if (geteuid() == 0 && (setgid(65534) != 0 || setuid(65534) != 0)) _exit(3);
}

bool MayBeRealtime() {
  return InProcess([] {
           torquer::EnterRealtime();
           return std::string("granted");
         }) == "granted";
}

}  // namespace

TEST_CASE("Real time takes this thread and later ones, but not who leaves it") {
  if (!MayBeRealtime()) {
    WARN("skipped: this user may not have real-time priority");
    return;
  }
  CHECK(InProcess([] {
          torquer::LeaveRealtime();
          torquer::EnterRealtime();
          std::ostringstream said;
          said << (sched_getscheduler(0) == SCHED_FIFO) << KeepsMemory()
               << (PolicyInThread([] {}) == SCHED_FIFO)
               << (PolicyInThread(torquer::LeaveRealtime) == SCHED_OTHER)
               << (sched_getscheduler(0) == SCHED_FIFO);
          return said.str();
        }) == "11111");
}

TEST_CASE("Leaving real time without entering it has no effect") {
  CHECK(InProcess([] {
          const sched_param none{};
          if (sched_setscheduler(0, SCHED_BATCH, &none) != 0) return std::string("no batch");
          torquer::LeaveRealtime();
          return std::string(sched_getscheduler(0) == SCHED_BATCH ? "batch" : "another");
        }) == "batch");
}

TEST_CASE("Without the limits real time is refused without effect") {
  const auto refused = [](rlim_t memory_bytes, rlim_t priority) {
    return InProcess([=] {
      const rlimit memory{memory_bytes, memory_bytes};
      const rlimit priorities{priority, priority};
      if (setrlimit(RLIMIT_RTPRIO, &priorities) != 0 || setrlimit(RLIMIT_MEMLOCK, &memory) != 0) {
        return std::string("limits cannot be set");
      }
      BecomeNobody();
      try {
        torquer::EnterRealtime();
        return std::string("granted");
      } catch (const torquer::UserError& error) {
        const bool left = KeepsMemory() || sched_getscheduler(0) != SCHED_OTHER;
        return std::string(left ? "not whole: " : "") + error.what();
      }
    });
  };
  CHECK_THAT(refused(0, 0), Catch::StartsWith("--realtime: this user may lock only 0 bytes"));
  const rlimit none{RLIM_INFINITY, RLIM_INFINITY};
  const bool may_raise = InProcess([&none] {
                           return std::string(setrlimit(RLIMIT_MEMLOCK, &none) == 0 ? "yes" : "no");
                         }) == "yes";
  if (!may_raise) {
    WARN("skipped: limits above this user's own");
  } else {
    // 256 MiB are enough for this process, but not for a session.
    CHECK_THAT(refused(1 << 28, 0),
               Catch::StartsWith("--realtime: this user may lock only 268435456 bytes") &&
                   Catch::Contains("'USER - memlock unlimited'"));
    CHECK_THAT(
        refused(RLIM_INFINITY, 19),
        Catch::StartsWith("--realtime: this user may have real-time priorities up to 19, but "
                          "20 is needed") &&
            Catch::Contains("'USER - rtprio 20'"));
    CHECK(refused(RLIM_INFINITY, 20) == "granted");
  }
}
