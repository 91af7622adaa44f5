// The daemon on unmodified libevdev, with a scripted mouse and joystick in a mocked kernel.
#include <catch2/catch.hpp>
#include <csignal>
#include <ctime>

#include "host/bus/clock.h"
#include "tests/support/daemon_process.h"
#include "tests/support/evdev_testbed.h"

namespace {

using torquer::bus::MonotonicUs;
using torquer::test::ChildProcess;
using torquer::test::EvdevScript;
using torquer::test::EvdevTestbed;
using torquer::test::Listener;
using torquer_lcm::instrument_command_t;

constexpr int kMouse = 5;
constexpr int kStick = 6;
constexpr double kMmPerCount = 25.4 / 1000;

EvdevScript Mouse() {
  EvdevScript script;
  script.name = "Mock mouse";
  script.keys = {BTN_LEFT, BTN_RIGHT, BTN_MIDDLE, BTN_SIDE};
  script.relative_axes = {REL_X, REL_Y};
  return script;
}

EvdevScript Stick() {
  EvdevScript script;
  script.name = "Mock stick";
  script.product_id = 0xc215;
  script.keys = {BTN_TRIGGER, BTN_THUMB, BTN_THUMB2, BTN_TOP};
  input_absinfo range{};
  range.minimum = -32768;
  range.maximum = 32767;
  script.absolute_axes = {{ABS_X, range}, {ABS_Y, range}};
  return script;
}

struct EvdevChain {
  EvdevChain() {
    mouse = testbed.Plug(kMouse, Mouse());
    stick = testbed.Plug(kStick, Stick());
  }
  std::unique_ptr<ChildProcess> Start(const std::vector<std::string>& devices) {
    std::vector<std::string> words{torquer::test::kDaemonProgram, "--source", "evdev",
                                   "--uncalibrated", "--json"};
    for (const std::string& device : devices) {
      words.emplace_back("--device");
      words.push_back(device);
    }
    return std::make_unique<ChildProcess>(words);
  }
  bool UntilCommand(const std::function<bool(const instrument_command_t&)>& wanted) {
    listener.Forget();
    return listener.Until(
        [&] { return !listener.commands.empty() && wanted(listener.commands.back()); });
  }
  // Waits until the daemon has taken the counts at the start for zero and the connection has
  // settled.
  void UntilReading(ChildProcess& daemon) {
    REQUIRE(daemon.WaitForError("reading device"));
    REQUIRE(listener.UntilCommands(10));
  }

  Listener listener{/*with_devices=*/true};
  EvdevTestbed testbed;
  std::string mouse, stick;
};

bool Near(double a, double b) { return std::abs(a - b) < 1e-9; }

}  // namespace

TEST_CASE("A mouse's raw deltas become insertion and rotation, with the kernel's time") {
  EvdevChain chain;
  const auto daemon = chain.Start({chain.mouse});
  chain.UntilReading(*daemon);
  CHECK(chain.testbed.Grabbed(kMouse));
  CHECK(chain.testbed.ClockId(kMouse) == CLOCK_MONOTONIC);
  CHECK(chain.listener.samples.back().device == "046d:c077");

  std::int64_t sent_us = 0;
  for (int i = 1; i <= 50; ++i) {
    sent_us = MonotonicUs();
    chain.testbed.Send(kMouse, {{EV_REL, REL_X, 7}, {EV_REL, REL_Y, -2}}, sent_us);
    // Sends one at a time: the mocked file holds less than the kernel's queue and splits events.
    REQUIRE(chain.UntilCommand([i](const instrument_command_t& command) {
      return Near(command.insertion_mm, 7 * i * kMmPerCount) &&
             Near(command.rotation_rad, -2 * i * kMmPerCount / 5.0);
    }));
  }
  CHECK(chain.listener.Until([&] {
    for (const auto& sample : chain.listener.samples) {
      if ((sample.device_time_us & 0xffffffff) == (sent_us & 0xffffffff)) return true;
    }
    return false;
  }));
  for (const auto& sample : chain.listener.samples) CHECK(sample.origin_us <= sample.receive_us);
  CHECK(chain.listener.commands.back().flags == torquer::protocol::kCommandUncalibrated);
  daemon->Signal(SIGTERM);
  CHECK(daemon->Wait() == 0);
  CHECK(chain.listener.counters["reports_lost"] == 0);
}

TEST_CASE("Buttons of mouse and joystick are pedals and clutch") {
  EvdevChain chain;
  const auto daemon = chain.Start({chain.stick, chain.mouse});
  chain.UntilReading(*daemon);
  const auto [device, key, meaning] = GENERATE(table<int, unsigned, int>({
      {kMouse, BTN_LEFT, 0},
      {kMouse, BTN_RIGHT, 1},
      {kMouse, BTN_MIDDLE, 2},
      {kStick, BTN_TRIGGER, 0},
      {kStick, BTN_THUMB, 1},
      {kStick, BTN_THUMB2, 2},
  }));
  const auto shows = [meaning = meaning](const instrument_command_t& command, bool down) {
    return command.xray == (down && meaning == 0) && command.contrast == (down && meaning == 1) &&
           ((command.flags & torquer::protocol::kCommandClutch) != 0) == (down && meaning == 2);
  };
  for (const int down : {1, 0}) {
    chain.testbed.Send(device, {{EV_KEY, key, down}}, MonotonicUs());
    CHECK(chain.UntilCommand(
        [&](const instrument_command_t& command) { return shows(command, down != 0); }));
  }
}

TEST_CASE("A fourth button of mouse or joystick takes the joystick from the C-arm") {
  EvdevChain chain;
  const auto daemon = chain.Start({chain.mouse, chain.stick});
  chain.UntilReading(*daemon);
  const auto [device, key] = GENERATE(table<int, unsigned>({
      {kMouse, BTN_SIDE},
      {kStick, BTN_TOP},
  }));
  chain.testbed.Send(device, {{EV_KEY, key, 1}}, MonotonicUs());
  chain.testbed.Send(kStick, {{EV_ABS, ABS_X, 32767}}, MonotonicUs());
  CHECK(chain.UntilCommand([](const instrument_command_t& command) {
    return (command.flags & torquer::protocol::kCommandStickTable) != 0;
  }));
  CHECK(chain.listener.Until([&] {
    const auto& commands = chain.listener.commands;
    return commands.size() > 60 &&
           commands.back().lao_rad == commands[commands.size() - 50].lao_rad;
  }));
}

TEST_CASE("The joystick turns the C-arm while the mouse lies still") {
  EvdevChain chain;
  const auto daemon = chain.Start({chain.mouse, chain.stick});
  chain.UntilReading(*daemon);
  chain.testbed.Send(kStick, {{EV_ABS, ABS_X, 32767}, {EV_ABS, ABS_Y, 32767}}, MonotonicUs());
  CHECK(chain.UntilCommand([](const instrument_command_t& command) {
    // Right means LAO; towards the user means CAU.
    return command.lao_rad > 0.1 && command.cra_rad < -0.1;
  }));
  const double insertion_mm = chain.listener.commands.back().insertion_mm;
  CHECK(insertion_mm == 0.0);
  chain.testbed.Send(kStick, {{EV_ABS, ABS_X, 0}, {EV_ABS, ABS_Y, 0}}, MonotonicUs());
  // After release the angle stays constant.
  CHECK(chain.listener.Until([&] {
    const auto& commands = chain.listener.commands;
    return commands.size() > 60 &&
           commands.back().lao_rad == commands[commands.size() - 50].lao_rad;
  }));
}

TEST_CASE("Events that the kernel dropped are counted and flagged, buttons are read again") {
  EvdevChain chain;
  const auto daemon = chain.Start({chain.mouse});
  chain.UntilReading(*daemon);
  chain.testbed.Send(kMouse, {{EV_REL, REL_X, 10}}, MonotonicUs());
  REQUIRE(chain.UntilCommand([](const instrument_command_t& command) {
    return Near(command.insertion_mm, 10 * kMmPerCount);
  }));
  chain.listener.Forget();
  chain.testbed.SetKeyState(kMouse, BTN_LEFT, true);
  chain.testbed.SendDropped(kMouse, MonotonicUs());
  REQUIRE(chain.listener.Until([&] {
    for (const instrument_command_t& command : chain.listener.commands) {
      if ((command.flags & torquer::protocol::kCommandLift) != 0) return true;
    }
    return false;
  }));
  CHECK(chain.UntilCommand([](const instrument_command_t& command) { return command.xray; }));
  chain.testbed.Send(kMouse, {{EV_REL, REL_X, 10}}, MonotonicUs());
  CHECK(chain.UntilCommand([](const instrument_command_t& command) {
    return Near(command.insertion_mm, 20 * kMmPerCount);
  }));
  REQUIRE(chain.listener.Until([&] { return chain.listener.counters["reports_lost"] == 1; }));
}

TEST_CASE("An unplugged mouse is waited for and continued from") {
  EvdevChain chain;
  const auto daemon = chain.Start({chain.mouse});
  chain.UntilReading(*daemon);
  chain.testbed.Send(kMouse, {{EV_REL, REL_X, 100}}, MonotonicUs());
  REQUIRE(chain.UntilCommand([](const instrument_command_t& command) {
    return Near(command.insertion_mm, 100 * kMmPerCount);
  }));
  chain.testbed.Unplug(kMouse);
  REQUIRE(chain.listener.UntilHealth("waiting for device", "Mock mouse was unplugged"));
  chain.testbed.Plug(kMouse + 10, Mouse());
  REQUIRE(chain.listener.UntilHealth("running", "is connected again"));
  REQUIRE(chain.UntilCommand([](const instrument_command_t&) { return true; }));
  chain.testbed.Send(kMouse + 10, {{EV_REL, REL_X, 50}}, MonotonicUs());
  CHECK(chain.UntilCommand([](const instrument_command_t& command) {
    return Near(command.insertion_mm, 150 * kMmPerCount);
  }));
}

TEST_CASE("Devices that will not do are refused with what will") {
  EvdevChain chain;
  std::vector<std::string> devices;
  std::string expected;
  SECTION("no path: the mice are named") {
    expected = "--device /dev/input/by-id/Mock_mouse  (Mock mouse)";
  }
  SECTION("a keyboard") {
    EvdevScript keyboard;
    keyboard.name = "Mock keyboard";
    keyboard.keys = {KEY_A};
    devices = {chain.testbed.Plug(9, keyboard)};
    expected = "/dev/input/by-id/Mock_keyboard (Mock keyboard) is neither a mouse nor a joystick";
  }
  SECTION("only a joystick") {
    devices = {chain.stick};
    expected = "0 are mice; give one mouse";
  }
  SECTION("two mice") {
    EvdevScript second = Mouse();
    second.name = "Second mouse";
    devices = {chain.mouse, chain.testbed.Plug(8, second)};
    expected = "2 are mice; give one mouse";
  }
  SECTION("a mouse that another program has grabbed") {
    EvdevScript taken = Mouse();
    taken.name = "Taken mouse";
    taken.refuses_grab = true;
    devices = {chain.testbed.Plug(7, taken)};
    expected = "/dev/input/by-id/Taken_mouse (Taken mouse) is grabbed by another program";
  }
  const auto daemon = chain.Start(devices);
  CHECK(daemon->Wait() == 2);
  CAPTURE(daemon->Error());
  CHECK(daemon->Error().find(expected) != std::string::npos);
}

TEST_CASE("Without permission on the mouse the group is named") {
  EvdevChain chain;
  std::filesystem::permissions(chain.testbed.Root() / "dev/input/event5",
                               std::filesystem::perms::none);
  // Drops all capabilities: root, even if only in the namespace, would get access anyway.
  ChildProcess daemon({"/usr/bin/setpriv", "--bounding-set=-all", "--inh-caps=-all",
                       torquer::test::kDaemonProgram, "--source", "evdev", "--uncalibrated",
                       "--device", chain.mouse});
  CHECK(daemon.Wait() == 2);
  CAPTURE(daemon.Error());
  CHECK(daemon.Error().find(chain.mouse + " may not be read by this user") != std::string::npos);
  CHECK(daemon.Error().find("usermod -aG input") != std::string::npos);
}

TEST_CASE("The option --list names mice and joysticks by paths that outlast a replug") {
  EvdevChain chain;
  ChildProcess program({torquer::test::kDaemonProgram, "--list"});
  CHECK(program.Wait() == 0);
  CAPTURE(program.Output());
  CHECK(program.Output().find("046d:c077  mouse  " + chain.mouse + "  (Mock mouse)") !=
        std::string::npos);
  CHECK(program.Output().find("046d:c215  joystick  " + chain.stick + "  (Mock stick)") !=
        std::string::npos);
}
