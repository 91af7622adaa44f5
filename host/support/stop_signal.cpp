#include "host/support/stop_signal.h"

#include <csignal>

namespace torquer {
namespace {

std::atomic<bool> requested = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may set nothing else");

}  // namespace

const std::atomic<bool>& StopOnSignal() {
  struct sigaction action {};
  action.sa_handler = [](int) { requested = true; };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // nohup ignores SIGHUP, and this must stay so.
  struct sigaction present {};
  if (sigaction(SIGHUP, nullptr, &present) != 0 || present.sa_handler != SIG_IGN) {
    sigaction(SIGHUP, &action, nullptr);
  }
  return requested;
}

}  // namespace torquer
