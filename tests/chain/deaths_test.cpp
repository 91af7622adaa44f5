// Failure tests of the chain: one of its programs dies or hangs, and the others react. The rows of
// the table in tests/README.md run in order on one running chain.
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "host/recorder/session_log.h"
#include "tests/chain/steering_page.h"
#include "tests/support/daemon_process.h"
#include "tests/support/reports.h"
#include "tests/support/socket_device.h"
#include "torquer_lcm/picture_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace torquer::test {
namespace {

// Resting hand with the X-ray pedal down; one report per millisecond.
class Hand {
 public:
  explicit Hand(SocketDevice& device) : device_(device), thread_([this] { Run(); }) {}
  ~Hand() {
    stop_ = true;
    thread_.join();
  }
  std::atomic<bool> silent = false;

 private:
  void Run() {
    protocol::InputReport report = StillReport();
    report.buttons = protocol::kButtonXray;
    while (!stop_) {
      report = Next(report);
      if (!silent) device_.Send(report);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  SocketDevice& device_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

using Program = std::unique_ptr<ChildProcess>;

struct Session {
  Session() {
    listener.bus->Subscribe<torquer_lcm::wire_state_t>(
        protocol::kWireStateChannel, [this](const torquer_lcm::wire_state_t& message) {
          state = message;
          ++states;
        });
    StartSimulator();
    StartDaemon();
    monitor = std::make_unique<ChildProcess>(std::vector{ProgramPath("torquer-monitor")});
    recorder = std::make_unique<ChildProcess>(std::vector{ProgramPath("torquer-recorder"), log});
    viewer = std::make_unique<ChildProcess>(std::vector{ProgramPath("torquer-viewer")});
  }
  void StartSimulator() {
    simulator = std::make_unique<ChildProcess>(std::vector<std::string>{
        ProgramPath("torquer-simulator"), "--scene", SourcePath("/host/scenes/drill_tube.toml")});
  }
  void StartDaemon() { daemon = std::make_unique<ChildProcess>(SocketWords(socket)); }

  bool InDoubt() const { return (state.status & protocol::kWireInDoubt) != 0; }
  bool Moves() {
    const int before = states;
    return listener.Until([&] { return states > before + 20 && !InDoubt(); });
  }
  bool HealthOf(const std::string& process, const std::string& word) const {
    for (const auto& one : listener.health) {
      if (one.process == process && Contains(one.state, word)) return true;
    }
    return false;
  }
  // True once the monitor prints `text` in its output from this call on.
  bool MonitorSays(const std::string& text) {
    const std::size_t from = monitor->Output().size();
    return listener.Until([&] { return Contains(monitor->Output().substr(from), text); });
  }

  Listener listener;
  std::string socket = listener.folder.Path("device");
  std::string log = listener.folder.Path("log");
  SocketDevice device{socket};
  Hand hand{device};
  torquer_lcm::wire_state_t state{};
  int states = 0;
  Program simulator, daemon, monitor, recorder, viewer;
};

// One row of the table: the failure, the expected reaction of the others, and the recovery.
struct Row {
  const char* name;
  void (*act)(Session&);
  bool (*others)(Session&);
  void (*undo)(Session&);
};

// The wire is held and in doubt. The simulator names the instrument without commands; the monitor
// reports how long the daemon has been silent.
bool DaemonIsMissed(Session& s) {
  return s.listener.Until([&] { return s.InDoubt(); }) &&
         s.listener.Until([&] { return s.HealthOf("simulator", "no commands for guidewire"); }) &&
         s.MonitorSays("silent for");
}
bool SimulatorIsMissed(Session& s) {
  s.listener.Forget();
  return s.MonitorSays("simulator silent for") && s.listener.UntilCommands(100);
}
bool DeviceIsMissed(Session& s) {
  return s.listener.UntilHolds(1) && !s.listener.holds.back().xray &&
         s.listener.Until([&] { return s.InDoubt(); });
}
bool NobodyNotices(Session& s) { return s.Moves(); }
// Commands of another sender, more than the queue holds.
void Flood(Session& s) {
  torquer_lcm::instrument_command_t command{};
  command.instrument = protocol::kGuidewire;
  command.insertion_mm = 50;
  for (command.sequence = 0; command.sequence < 20000; ++command.sequence) {
    s.listener.bus->Publish(protocol::kInstrumentCommandChannel, command);
  }
}
// The commands are refused and counted; the wire still follows its own hand.
bool FloodIsRefused(Session& s) {
  return s.listener.Until([&] { return s.listener.counters["refused_senders"] > 0; }) &&
         s.Moves() && s.state.instruments[0].insertion_mm < 1;
}
void Nothing(Session&) {}

const Row kRows[] = {
    {"device: hang", [](Session& s) { s.hand.silent = true; }, DeviceIsMissed,
     [](Session& s) { s.hand.silent = false; }},
    {"device: gone", [](Session& s) { s.device.Unplug(true); }, DeviceIsMissed,
     [](Session& s) { s.device.Return(); }},
    {"daemon: SIGSTOP", [](Session& s) { s.daemon->Signal(SIGSTOP); }, DaemonIsMissed,
     [](Session& s) { s.daemon->Signal(SIGCONT); }},
    {"daemon: kill -9", [](Session& s) { s.daemon->Signal(SIGKILL); }, DaemonIsMissed,
     [](Session& s) { s.StartDaemon(); }},
    {"monitor: SIGSTOP", [](Session& s) { s.monitor->Signal(SIGSTOP); }, NobodyNotices,
     [](Session& s) { s.monitor->Signal(SIGCONT); }},
    {"recorder: SIGSTOP", [](Session& s) { s.recorder->Signal(SIGSTOP); }, NobodyNotices,
     [](Session& s) { s.recorder->Signal(SIGCONT); }},
    {"simulator: SIGSTOP", [](Session& s) { s.simulator->Signal(SIGSTOP); }, SimulatorIsMissed,
     [](Session& s) { s.simulator->Signal(SIGCONT); }},
    {"simulator: kill -9", [](Session& s) { s.simulator->Signal(SIGKILL); }, SimulatorIsMissed,
     [](Session& s) { s.StartSimulator(); }},
    {"viewer: SIGSTOP", [](Session& s) { s.viewer->Signal(SIGSTOP); }, NobodyNotices,
     [](Session& s) { s.viewer->Signal(SIGCONT); }},
    {"viewer: kill -9", [](Session& s) { s.viewer->Signal(SIGKILL); }, NobodyNotices, Nothing},
    {"stranger: flood", Flood, FloodIsRefused, Nothing},
    {"monitor: kill -9", [](Session& s) { s.monitor->Signal(SIGKILL); }, NobodyNotices, Nothing},
    {"recorder: kill -9", [](Session& s) { s.recorder->Signal(SIGKILL); }, NobodyNotices, Nothing},
};

TEST_CASE(
    "After the death or hang of a program the others report it, hold, and continue when it is "
    "back") {
  Session session;
  REQUIRE(session.device.WaitForHost());
  REQUIRE(session.Moves());
  for (const Row& row : kRows) {
    INFO(row.name);
    session.listener.Forget();
    row.act(session);
    CHECK(row.others(session));
    row.undo(session);
    REQUIRE(session.Moves());
  }
  // Everything recorded before the recorder was killed is intact, except for at most its last
  // record.
  std::int64_t recorded = 0;
  SessionHandlers handlers;
  handlers.state = [&recorded](const torquer_lcm::wire_state_t&) { ++recorded; };
  const SessionLogSummary summary = ReadSessionLog(session.log, handlers);
  CHECK(recorded > 100);
  CHECK(summary.damage.places == 0);
  CHECK(summary.damage.missing == 0);
}

TEST_CASE("A viewer that steers dies or hangs with its pedal down: no X-ray, no motion") {
  Listener listener;
  torquer_lcm::wire_state_t state{};
  std::int64_t pictures = 0;
  double newest_s = 0;  // time of the newest picture
  listener.bus->Subscribe<torquer_lcm::wire_state_t>(
      protocol::kWireStateChannel,
      [&state](const torquer_lcm::wire_state_t& message) { state = message; });
  listener.bus->Subscribe<torquer_lcm::picture_t>(
      protocol::kPictureChannel, [&pictures, &newest_s](const torquer_lcm::picture_t& picture) {
        pictures = picture.number;
        newest_s = picture.time_s;
      });
  const ChildProcess simulator(
      {ProgramPath("torquer-simulator"), "--scene", SourcePath("/host/scenes/coronary.toml")});
  const int how = GENERATE(SIGSTOP, SIGKILL);
  CAPTURE(how);
  ChildProcess viewer({ProgramPath("torquer-viewer"), "--steer"});
  REQUIRE(listener.Until([&] { return Contains(viewer.Output(), "http://"); }));
  const SteeringPage page(viewer.Output(), SteeringPage::kXray);
  REQUIRE(listener.Until([&] {
    return pictures > 3 && (state.status & protocol::kWireInDoubt) == 0 && state.time_s > 0 &&
           state.instruments[0].insertion_mm > state.instruments[0].inserted_at_start_mm + 2;
  }));

  viewer.Signal(how);
  REQUIRE(listener.Until([&] { return (state.status & protocol::kWireInDoubt) != 0; }));
  // Waits until commands in transit have arrived.
  const double then_s = state.time_s;
  REQUIRE(listener.Until([&] { return state.time_s > then_s + 0.2; }));
  const double held_mm = state.instruments[0].insertion_mm;
  REQUIRE(listener.Until([&] { return state.time_s > then_s + 1.5; }));
  // The picture thread of a busy machine is late, but its pictures are of pulses before the end.
  CHECK(newest_s <= then_s + 0.2);
  CHECK(state.instruments[0].insertion_mm == held_mm);
  CHECK((state.status & protocol::kWireInDoubt) != 0);
  if (how == SIGSTOP) viewer.Signal(SIGKILL);
}

}  // namespace
}  // namespace torquer::test
