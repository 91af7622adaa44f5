// The daemon as a process: a scripted device behind a socket, commands read back from the bus.
#include <catch2/catch.hpp>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "calibration/calibration_file.h"
#include "host/bus/bus.h"
#include "host/bus/channels.h"
#include "host/bus/clock.h"
#include "tests/daemon/reports.h"
#include "tests/daemon/socket_device.h"
#include "tests/support/child_process.h"
#include "tests/support/private_network.h"
#include "tests/support/temporary_folder.h"
#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace {

using torquer::protocol::InputReport;
using torquer::test::ChildProcess;
using torquer::test::Next;
using torquer::test::SocketDevice;
using torquer::test::StillReport;
using torquer_lcm::device_sample_t;
using torquer_lcm::health_t;
using torquer_lcm::instrument_command_t;

constexpr double kMmPerCount = 25.4 / 1200;
constexpr char kDaemon[] = TORQUER_BIN_DIR "/torquer-daemon";

// What the daemon tells the world, and a folder for its claims.
struct Listener {
  Listener() {
    torquer::test::NeedPrivateNetwork();
    setenv("XDG_RUNTIME_DIR", folder.Path().c_str(), 1);
    unsetenv("LCM_DEFAULT_URL");
    bus.emplace("");
    bus->Subscribe<instrument_command_t>(
        torquer::bus::kInstrumentCommandChannel,
        [this](const instrument_command_t& command) { commands.push_back(command); }, 0);
    bus->Subscribe<device_sample_t>(
        torquer::bus::kDeviceSampleChannel,
        [this](const device_sample_t& sample) { samples.push_back(sample); }, 0);
    bus->Subscribe<health_t>(
        torquer::bus::kHealthChannel,
        [this](const health_t& message) {
          health.push_back(message);
          for (std::size_t i = 0; i < message.names.size(); ++i) {
            counters[message.names[i]] = message.values[i];
          }
        },
        0);
  }

  bool Until(const std::function<bool()>& done) {
    for (int i = 0; i < 600 && !done(); ++i) bus->Handle(50);
    return done();
  }
  bool UntilCommands(std::size_t count) {
    return Until([&] { return commands.size() >= count; });
  }
  bool UntilHealth(const std::string& state, const std::string& message) {
    return Until([&] {
      for (const health_t& told : health) {
        if (told.state == state && told.message.find(message) != std::string::npos) return true;
      }
      return false;
    });
  }

  torquer::test::TemporaryFolder folder;
  std::optional<torquer::bus::Bus> bus;
  std::vector<instrument_command_t> commands;
  std::vector<device_sample_t> samples;
  std::vector<health_t> health;
  std::map<std::string, std::int64_t> counters;
};

std::vector<std::string> Words(const std::string& socket,
                               const std::vector<std::string>& more = {"--uncalibrated"}) {
  std::vector<std::string> words{kDaemon, "--source", "socket", "--socket", socket};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

}  // namespace

TEST_CASE("Reports become commands, one for one") {
  Listener listener;
  const std::string socket = listener.folder.Path("device");
  SocketDevice device(socket);
  ChildProcess daemon(Words(socket, {"--uncalibrated", "--json"}));
  REQUIRE(device.WaitForHost());

  InputReport report = StillReport(65000);
  report.axial_counts = 2147483600;  // wraps on the way, as does the sequence
  report.device_time_us = 4294000000u;
  report.buttons = torquer::protocol::kButtonXray;
  constexpr int kReports = 1500;
  for (int i = 0; i < kReports; ++i) {
    device.Send(report);
    report = Next(report);
    report.axial_counts =
        static_cast<std::int32_t>(static_cast<std::uint32_t>(report.axial_counts) + 3u);
    report.transverse_counts -= 2;
  }
  REQUIRE(listener.UntilCommands(kReports));
  REQUIRE(listener.Until([&] { return listener.samples.size() >= kReports; }));

  for (std::size_t i = 0; i < kReports; ++i) {
    const instrument_command_t& command = listener.commands[i];
    const auto step = static_cast<double>(i);
    REQUIRE(command.instrument == "guidewire");
    REQUIRE(command.sequence == static_cast<std::int64_t>(i));
    REQUIRE(command.insertion_mm == Approx(3 * kMmPerCount * step).margin(1e-12));
    REQUIRE(command.rotation_rad == Approx(-2 * kMmPerCount / 5.0 * step).margin(1e-12));
    REQUIRE(command.xray);
    REQUIRE_FALSE(command.contrast);
    REQUIRE(command.flags == torquer::bus::kCommandUncalibrated);
    REQUIRE(command.clock_id == torquer::bus::ClockId());
    const device_sample_t& sample = listener.samples[i];
    REQUIRE(sample.device == "SCRIPTED-1");
    REQUIRE(sample.report_number == 65000 + static_cast<std::int64_t>(i));
    REQUIRE(sample.axial_counts == 2147483600 + 3 * static_cast<std::int64_t>(i));
    REQUIRE(sample.device_time_us == 4294000000 + 1000 * static_cast<std::int64_t>(i));
    REQUIRE(sample.origin_us == command.origin_us);
    REQUIRE(sample.origin_us <= sample.receive_us);
    REQUIRE(sample.receive_us <= command.publish_us);
  }

  daemon.Signal(SIGTERM);
  CHECK(daemon.Wait() == 0);
  REQUIRE(listener.UntilHealth("stopping", "asked to stop"));
  CHECK(listener.counters["reports_received"] == kReports);
  CHECK(listener.counters["reports_lost"] == 0);
  CHECK(listener.counters["axial_counts_applied"] == 3 * (kReports - 1));
  const auto statistics = nlohmann::json::parse(daemon.Output());
  CHECK(statistics.at("reports_received") == kReports);
  CHECK(statistics.at("commands_published") == kReports);
  CHECK(statistics.at("report_to_command_p99_us").is_number());
  CHECK(statistics.at("cpu_percent_of_core").is_number());
}
