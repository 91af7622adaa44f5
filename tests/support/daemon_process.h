// Daemon as a process, and a listener for its messages on the bus. For tests in a private network.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "protocol/lcm_channels.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"
#include "tests/support/temporary_folder.h"
#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/instrument_command_t.hpp"

namespace torquer::test {

inline const std::string kDaemonProgram = ProgramPath("torquer-daemon");

/// Collects all published messages in a private network, with mocked devices if requested. Its
/// folder holds the daemons' claims, files stored for devices, and files of the test.
struct Listener {
  explicit Listener(bool with_devices = false) : folder(InPrivateNetwork(with_devices)) {
    setenv("XDG_RUNTIME_DIR", folder.Path().c_str(), 1);
    setenv("XDG_CONFIG_HOME", folder.Path().c_str(), 1);
    unsetenv("LCM_DEFAULT_URL");
    bus.emplace("");
    bus->Subscribe<torquer_lcm::instrument_command_t>(
        torquer::protocol::kInstrumentCommandChannel,
        [this](const torquer_lcm::instrument_command_t& command) {
          const bool held = (command.flags & torquer::protocol::kCommandNoDevice) != 0;
          (held ? holds : commands).push_back(command);
        },
        0);
    bus->Subscribe<torquer_lcm::device_sample_t>(
        torquer::protocol::kDeviceSampleChannel,
        [this](const torquer_lcm::device_sample_t& sample) { samples.push_back(sample); }, 0);
    bus->Subscribe<torquer_lcm::health_t>(
        torquer::protocol::kHealthChannel,
        [this](const torquer_lcm::health_t& message) {
          health.push_back(message);
          for (std::size_t i = 0; i < message.names.size(); ++i) {
            counters[message.names[i]] = message.values[i];
          }
        },
        0);
  }

  /// Handles messages until `done`, for at most 30 s; returns the result of `done`.
  bool Until(const std::function<bool()>& done) {
    const std::int64_t end_us = torquer::bus::MonotonicUs() + 30000000;
    while (!done() && torquer::bus::MonotonicUs() < end_us) bus->Handle(50);
    return done();
  }
  bool UntilCommands(std::size_t count) {
    return Until([&] { return commands.size() >= count; });
  }
  bool UntilHolds(std::size_t count) {
    return Until([&] { return holds.size() >= count; });
  }
  /// Waits for a health message with that state whose text contains `text`.
  bool UntilHealth(const std::string& state, const std::string& text) {
    return Until([&] {
      for (const torquer_lcm::health_t& one : health) {
        if (one.state == state && one.message.find(text) != std::string::npos) return true;
      }
      return false;
    });
  }
  void Forget() {
    commands.clear();
    holds.clear();
    samples.clear();
    health.clear();
  }

  TemporaryFolder folder;
  std::optional<torquer::bus::Bus> bus;
  std::vector<torquer_lcm::instrument_command_t> commands;  ///< made from reports
  std::vector<torquer_lcm::instrument_command_t> holds;     ///< device missing or silent
  std::vector<torquer_lcm::device_sample_t> samples;
  std::vector<torquer_lcm::health_t> health;
  std::map<std::string, std::int64_t> counters;  ///< newest value by name

 private:
  // The folder is made in the network: a restart of the program would leave an earlier one.
  static TemporaryFolder InPrivateNetwork(bool with_devices) {
    with_devices ? NeedPrivateNetworkAndDevices() : NeedPrivateNetwork();
    return TemporaryFolder();
  }
};

/// Command line of the daemon for a device behind `socket`.
inline std::vector<std::string> SocketWords(const std::string& socket,
                                            const std::vector<std::string>& more = {
                                                "--uncalibrated"}) {
  std::vector<std::string> words{kDaemonProgram, "--source", "socket", "--socket", socket};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

}  // namespace torquer::test
