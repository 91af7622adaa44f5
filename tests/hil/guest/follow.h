// Main loop that the follow_* programs share: prints the newest message of a channel.
#pragma once

#include <csignal>
#include <cstdio>
#include <functional>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "protocol/lcm_channels.h"

namespace torquer::test {

inline volatile std::sig_atomic_t follow_stop_requested = 0;

/// Calls `print` with the newest message of `channel`, at most ten times a second, until SIGTERM.
template <class Message>
void Follow(const char* channel, const std::function<void(const Message&)>& print) {
  constexpr std::int64_t kIntervalUs = 100000;
  struct sigaction action {};
  action.sa_handler = [](int) { follow_stop_requested = 1; };
  sigaction(SIGTERM, &action, nullptr);
  bus::Bus bus;
  Message newest{};
  bool fresh = false;
  bus.Subscribe<Message>(channel, [&](const Message& message) {
    newest = message;
    fresh = true;
  });
  std::int64_t printed_us = 0;
  while (!follow_stop_requested) {
    bus.Handle(50);
    const std::int64_t now_us = bus::MonotonicUs();
    if (!fresh || now_us - printed_us < kIntervalUs) continue;
    fresh = false;
    printed_us = now_us;
    print(newest);
    std::fflush(stdout);
  }
}

}  // namespace torquer::test
