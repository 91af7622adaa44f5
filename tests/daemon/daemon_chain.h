// Test fixture: the daemon as a process, with a scripted device behind a socket.
#pragma once

#include <catch2/catch.hpp>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/daemon_process.h"
#include "tests/support/reports.h"
#include "tests/support/socket_device.h"

namespace torquer::test {

constexpr double kMmPerCount = 25.4 / 1200;

/// A device and the daemon that reads it.
struct Chain {
  explicit Chain(const std::vector<std::string>& words = {"--uncalibrated"})
      : socket(listener.folder.Path("device")), device(socket) {
    Start(words);
  }
  /// Starts the daemon in place of the previous one.
  void Start(const std::vector<std::string>& words = {"--uncalibrated"}) {
    daemon.reset();
    daemon = std::make_unique<ChildProcess>(SocketWords(socket, words));
  }
  /// Advances the hand by `axial_counts` in ten reports; returns the last resulting command.
  torquer_lcm::instrument_command_t Push(int axial_counts) {
    listener.Forget();
    for (int i = 0; i < 10; ++i) {
      report = Next(report);
      report.axial_counts += axial_counts / 10;
      device.Send(report);
    }
    REQUIRE(listener.UntilCommands(10));
    return listener.commands.back();
  }

  Listener listener;
  std::string socket;
  SocketDevice device;
  protocol::InputReport report = StillReport();
  std::unique_ptr<ChildProcess> daemon;
};

/// Exit status and error output of a daemon started with these arguments.
struct Ending {
  int status;
  std::string error;
};
inline Ending EndingOf(const std::vector<std::string>& words) {
  ChildProcess daemon(words);
  const int status = daemon.Wait();
  return {status, daemon.Error()};
}

inline bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace torquer::test
