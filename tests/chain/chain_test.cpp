// End-to-end test of the chain that host/demo runs: from the firmware's sensor to the recorded
// wire.

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>
#include <string>
#include <vector>

#include "host/bus/bus.h"
#include "protocol/lcm_channels.h"
#include "tests/support/child_process.h"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"
#include "tests/support/temporary_folder.h"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

using namespace torquer::test;
using torquer_lcm::wire_state_t;

namespace {

const std::string kDemo = SourcePath("/host/demo");
const std::string kPrograms = ProgramPath("");
const std::string kScene = SourcePath("/host/scenes/ty_phantom.toml");

int Run(const std::string& command) {
  INFO(command);
  const int status = std::system(command.c_str());
  REQUIRE(WIFEXITED(status));
  return WEXITSTATUS(status);
}

std::string LastLine(const std::string& text) {
  const std::size_t end = text.find_last_not_of('\n');
  const std::size_t start = text.rfind('\n', end);
  return text.substr(start + 1, end - start);
}

wire_state_t LastState(const std::string& log_path) {
  lcm::LogFile log(log_path, "r");
  REQUIRE(log.good());
  wire_state_t state{};
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    if (event->channel == torquer::protocol::kWireStateChannel) {
      REQUIRE(state.decode(event->data, 0, event->datalen) == event->datalen);
    }
  }
  return state;
}

// Latencies in ms of all commands that a state reports: from hand motion to publishing of the
// state.
std::vector<double> Latencies(const std::string& log_path) {
  lcm::LogFile log(log_path, "r");
  REQUIRE(log.good());
  std::map<std::int64_t, std::int64_t> origin_us;  // by sequence
  std::map<std::int64_t, std::int64_t> shown_us;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    if (event->channel == torquer::protocol::kInstrumentCommandChannel) {
      torquer_lcm::instrument_command_t command{};
      REQUIRE(command.decode(event->data, 0, event->datalen) == event->datalen);
      origin_us[command.sequence] = command.origin_us;
    } else if (event->channel == torquer::protocol::kWireStateChannel) {
      wire_state_t state{};
      REQUIRE(state.decode(event->data, 0, event->datalen) == event->datalen);
      shown_us.emplace(state.instruments.at(0).command_sequence, state.publish_us);
    }
  }
  std::vector<double> latencies_ms;
  for (const auto& [sequence, at_us] : shown_us) {
    if (sequence < 0) continue;
    REQUIRE(origin_us.contains(sequence));
    latencies_ms.push_back(1e-3 * static_cast<double>(at_us - origin_us[sequence]));
    CHECK(latencies_ms.back() > 0);
  }
  return latencies_ms;
}

// True if `value` is the smallest of the values that has at least this `part` at or below it.
bool IsQuantile(double value, double part, const std::vector<double>& values) {
  const auto count = static_cast<double>(values.size());
  const auto at_or_below =
      std::count_if(values.begin(), values.end(), [&](double v) { return v < value + 1e-9; });
  const auto below =
      std::count_if(values.begin(), values.end(), [&](double v) { return v < value - 1e-9; });
  return below < at_or_below && static_cast<double>(at_or_below) >= part * count &&
         static_cast<double>(below) < part * count;
}

// Replays a log's commands at `speed` to a newly started simulator.
wire_state_t PlayCommands(const std::string& log, double speed, std::int64_t last_sequence) {
  torquer::bus::Bus bus;
  std::optional<wire_state_t> newest;
  bus.Subscribe<wire_state_t>(
      torquer::protocol::kWireStateChannel, [&](const wire_state_t& state) { newest = state; }, 0);
  ChildProcess simulator({kPrograms + "/torquer-simulator", "--scene", kScene});
  const auto until = [&bus](const auto& done) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(2);
    while (!done() && std::chrono::steady_clock::now() < end) bus.Handle(100);
    return done();
  };
  REQUIRE(until([&] { return newest.has_value(); }));
  REQUIRE(newest->instruments.size() == 1);
  REQUIRE(newest->instruments[0].command_sequence == -1);
  const std::string play = "lcm-logplayer --speed=" + std::to_string(speed) +
                           " --regexp=" + torquer::protocol::kInstrumentCommandChannel + " " + log +
                           " >/dev/null";
  REQUIRE(Run(play) == 0);
  CHECK(until([&] {
    const torquer_lcm::instrument_state_t& wire = newest->instruments[0];
    return wire.command_sequence >= last_sequence && wire.carried_mm == 0;
  }));
  simulator.Signal(SIGTERM);
  CHECK(simulator.Wait() == 0);
  return *newest;
}

// Names of running programs that have a path in `folder` among their arguments.
std::string ProgramsUsing(const std::string& folder) {
  std::string names;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string words = Contents(entry.path() / "cmdline");
    if (words.find(folder) != std::string::npos) names += words.substr(0, words.find('\0')) + " ";
  }
  return names;
}

}  // namespace

TEST_CASE("A session has no losses, repeats bit for bit, and plays at another speed") {
  NeedPrivateNetwork();
  const TemporaryFolder folder;
  const std::string output = folder.Path("output");
  REQUIRE(Run("cd / && bash " + kDemo + " --scene ty_phantom --duration 10 --json --programs " +
              kPrograms + " --files " + folder.Path("session") + " >" + output) == 0);
  const std::string said = Contents(output);
  CHECK_THAT(said, Catch::Contains("nsenter") && Catch::Contains("reports/s"));
  const auto summary = nlohmann::json::parse(LastLine(said));
  REQUIRE(summary["instruments"].size() == 1);
  const auto& guidewire = summary["instruments"][0];
  CHECK(guidewire["name"] == "guidewire");
  CHECK(guidewire["reports_sent"].get<int>() > 9000);
  CHECK(guidewire["reports_received"] == guidewire["reports_sent"]);
  CHECK(guidewire["reports_lost"] == 0);
  CHECK(guidewire["motion_error_counts"].get<double>() <= 1);
  CHECK(guidewire["rotation_error_counts"].get<double>() <= 1);
  CHECK(guidewire["insertion_mm"].get<double>() > 20);
  CHECK(summary["max_penetration_um"].get<double>() >= 0);
  CHECK(summary["nodes"].get<int>() > 20);
  CHECK(summary["residual"].get<double>() >= 0);
  CHECK_THAT(Contents(summary["picture"]), Catch::StartsWith("<svg"));
  CHECK_THAT(Contents(summary["page"]), Catch::StartsWith("<!DOCTYPE html>") &&
                                            Catch::Contains("Time line") &&
                                            Catch::Contains("</html>"));

  const std::string log = folder.Path("session/latest/session.lcmlog");
  const std::vector<double> latencies_ms = Latencies(log);
  REQUIRE(latencies_ms.size() > 100);
  CHECK(IsQuantile(guidewire["latency_ms_p50"], 0.5, latencies_ms));
  CHECK(IsQuantile(guidewire["latency_ms_p99"], 0.99, latencies_ms));
  CHECK(IsQuantile(guidewire["latency_ms_p999"], 0.999, latencies_ms));
  CHECK(IsQuantile(guidewire["latency_ms_max"], 1, latencies_ms));
  const wire_state_t recorded = LastState(log);
  const std::string replay = folder.Path("replay");
  CHECK(Run(kPrograms + "/torquer-simulator --scene " + kScene + " --replay " + log + " >" +
            replay) == 0);
  CHECK_THAT(Contents(replay), Catch::Contains(" 0 differ"));

  REQUIRE(recorded.instruments.size() == 1);
  const torquer_lcm::instrument_state_t& wire = recorded.instruments[0];
  const wire_state_t played = PlayCommands(log, 4, wire.command_sequence);
  CHECK(played.instruments[0].insertion_mm == Approx(wire.insertion_mm).margin(1e-9));
  CHECK(played.instruments[0].rotation_rad == Approx(wire.rotation_rad).margin(1e-9));
}

TEST_CASE("A stopped demo leaves no program running") {
  const TemporaryFolder folder;
  {
    ChildProcess demo({"/bin/bash", kDemo, "--scene", "ty_phantom", "--programs", kPrograms,
                       "--files", folder.Path("session")});
    for (int i = 0; i < 300 && demo.Output().find("reports/s") == std::string::npos; ++i) {
      usleep(100000);
    }
    CHECK_THAT(ProgramsUsing(folder.Path()), Catch::Contains("torquer-emulator"));
    demo.Signal(SIGTERM);
    CHECK(demo.Wait() == 143);
  }
  CHECK(ProgramsUsing(folder.Path()).empty());
}

TEST_CASE("A demo at the keyboard serves its page outside its network, and ends in good order") {
  const TemporaryFolder folder;
  ChildProcess demo({"/bin/bash", kDemo, "--keyboard", "--scene", "ty_phantom", "--duration", "3",
                     "--programs", kPrograms, "--files", folder.Path("session")});
  std::smatch link;
  const std::regex form("http://127\\.0\\.0\\.1:([0-9]+)/[0-9a-f]{32}/");
  std::string said;
  for (int i = 0; i < 600 && !std::regex_search(said, link, form); ++i) {
    usleep(50000);
    said = demo.Output();
  }
  REQUIRE(link.size() == 2);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(link[1])));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int client = socket(AF_INET, SOCK_STREAM, 0);
  CHECK(connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  close(client);
  CHECK(demo.Wait() == 0);
  CHECK(ProgramsUsing(folder.Path()).empty());
}

TEST_CASE("A demo on a terminal prints its page's link, and Ctrl-C ends it with its report") {
  NeedPrivateNetwork();
  const TemporaryFolder folder;
  const std::string output = folder.Path("output");
  // Sends Ctrl-C as a key, then keeps the writer alive as long as the terminal. The terminal has no
  // shell beside the demo, because Ctrl-C would end it too.
  const std::string keys = "for i in $(seq 600); do grep -qs 'guidewire [1-9]' " + output +
                           " && break; sleep 0.1; done; sleep 1; printf '\\003'; "
                           "while printf ' '; do sleep 0.1; done";
  CHECK(Run("touch " + output + "; (" + keys +
            ") 2>/dev/null | timeout 100 script -qec 'exec bash " + kDemo +
            " --scene ty_phantom --programs " + kPrograms + " --files " + folder.Path("session") +
            "' /dev/null >" + output) == 0);
  const std::string said = Contents(output);
  CHECK(std::regex_search(said, std::regex("http://127\\.0\\.0\\.1:[0-9]+/[0-9a-f]{32}/")));
  CHECK_THAT(said, Catch::Contains("Ctrl-C ends the session") && Catch::Contains("Session of ") &&
                       Catch::Contains("0 lost"));
  CHECK_THAT(Contents(folder.Path("session/latest/wire.svg")), Catch::StartsWith("<svg"));
  CHECK(ProgramsUsing(folder.Path()).empty());
}

TEST_CASE("A demo that cannot run reports the reason") {
  const TemporaryFolder folder;
  const std::string error = folder.Path("error");
  const auto demo = [&](const std::string& arguments) {
    return Run("bash " + kDemo + " --programs " + kPrograms + " --files " + folder.Path("session") +
               " " + arguments + " 2>" + error + " >/dev/null");
  };
  CHECK(demo("--scene atlantis") == 2);
  CHECK_THAT(Contents(error), Catch::Contains("atlantis") && Catch::Contains("ty_phantom"));
  CHECK(demo("--scene ty_phantom --duration soon") == 2);
  CHECK_THAT(Contents(error), Catch::Contains("soon"));
  CHECK(demo("--duration") == 2);
  CHECK(demo("--fly") == 2);
  CHECK_THAT(Contents(error), Catch::Contains("--fly"));
}
