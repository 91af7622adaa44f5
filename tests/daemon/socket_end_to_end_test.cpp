// End-to-end test of the daemon as a process: scripted device behind a socket, commands from the
// bus.
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "calibration/calibration_file.h"
#include "host/bus/clock.h"
#include "tests/daemon/daemon_chain.h"

namespace {

using torquer::protocol::InputReport;
using torquer::test::Chain;
using torquer::test::ChildProcess;
using torquer::test::Contains;
using torquer::test::Ending;
using torquer::test::EndingOf;
using torquer::test::kMmPerCount;
using torquer::test::Listener;
using torquer::test::Next;
using torquer::test::SocketDevice;
using torquer::test::SocketWords;
using torquer::test::StillReport;
using torquer_lcm::device_sample_t;
using torquer_lcm::instrument_command_t;

}  // namespace

TEST_CASE("Reports become commands, one for one") {
  Listener listener;
  const std::string socket = listener.folder.Path("device");
  SocketDevice device(socket);
  ChildProcess daemon(SocketWords(socket, {"--uncalibrated", "--json"}));
  REQUIRE(device.WaitForHost());

  InputReport report = StillReport(65000);
  report.axial_counts = 2147483600;  // wraps during the test, as does the sequence
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
    REQUIRE((i == 0 || command.sequence > listener.commands[i - 1].sequence));
    REQUIRE(command.insertion_mm == Approx(3 * kMmPerCount * step).margin(1e-12));
    REQUIRE(command.rotation_rad == Approx(-2 * kMmPerCount / 5.0 * step).margin(1e-12));
    REQUIRE(command.xray);
    REQUIRE_FALSE(command.contrast);
    REQUIRE(command.flags == torquer::protocol::kCommandUncalibrated);
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
  CHECK(listener.counters.contains("report_to_command_p99_us"));
  const auto statistics = nlohmann::json::parse(daemon.Output());
  CHECK(statistics.at("reports_received") == kReports);
  CHECK(statistics.at("commands_published") >= kReports);
  CHECK(statistics.at("report_to_command_p99_us").is_number());
  CHECK(statistics.at("cpu_percent_of_core").is_number());
}

TEST_CASE("An unplugged device is waited for and continued from without a jump") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  const instrument_command_t before = chain.Push(1000);
  CHECK(before.insertion_mm == Approx(900 * kMmPerCount));  // the first report is the reference

  chain.listener.Forget();
  chain.device.Unplug(/*stay_away=*/true);
  REQUIRE(chain.listener.UntilHealth("waiting for device", "closed by the device"));
  REQUIRE(chain.listener.UntilHolds(3));
  for (const instrument_command_t& command : chain.listener.holds) {
    CHECK(command.insertion_mm == before.insertion_mm);
    CHECK_FALSE(command.xray);
  }
  CHECK(chain.listener.commands.empty());

  chain.device.Return();
  REQUIRE(chain.device.WaitForHost());
  chain.report.boot_id = 8;
  chain.report.axial_counts = -5000;  // any value: the device was off
  chain.report.sequence = 40000;
  const instrument_command_t after = chain.Push(500);
  CHECK(after.insertion_mm == Approx(before.insertion_mm + 450 * kMmPerCount));
  CHECK(after.sequence > before.sequence);
  REQUIRE(chain.listener.UntilHealth("running", "the motion of the hand in between is unknown"));
  CHECK(chain.listener.counters["connections"] == 2);
  CHECK(chain.listener.counters["reports_lost"] == 0);
}

TEST_CASE("A reset of the device is reported, and motion continues without a jump") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  const instrument_command_t before = chain.Push(1000);
  ++chain.report.boot_id;
  chain.report.axial_counts = 0;
  chain.report.sequence = 0;
  chain.report.device_time_us = 0;
  const instrument_command_t after = chain.Push(200);
  CHECK(after.insertion_mm == Approx(before.insertion_mm + 180 * kMmPerCount));
  REQUIRE(chain.listener.UntilHealth("running", "the device was reset"));
  CHECK(chain.listener.counters["device_resets"] == 1);
  CHECK(chain.listener.counters["reports_lost"] == 0);
}

TEST_CASE("A silent device is reported, and its position is held") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  const instrument_command_t before = chain.Push(1000);
  chain.listener.Forget();
  REQUIRE(chain.listener.UntilHealth("device silent", "sends no reports"));
  REQUIRE(chain.listener.UntilHolds(2));
  CHECK(chain.listener.holds.back().insertion_mm == before.insertion_mm);
  // Counts are cumulative: motion in the meantime is not lost.
  const instrument_command_t after = chain.Push(500);
  CHECK(after.insertion_mm == Approx(before.insertion_mm + 500 * kMmPerCount));
  REQUIRE(chain.listener.UntilHealth("running", "reports arrive again"));
}

TEST_CASE("A lifted sensor is reported in every command and on the health channel") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  const instrument_command_t before = chain.Push(1000);
  chain.report.flags = torquer::protocol::kFlagLift;
  CHECK(chain.Push(500).insertion_mm == before.insertion_mm);
  for (const instrument_command_t& command : chain.listener.commands) {
    CHECK((command.flags & torquer::protocol::kCommandLift) != 0);
  }
  REQUIRE(chain.listener.UntilHealth("sensor lifted", "motion is held"));
  chain.report.flags = 0;
  const instrument_command_t after = chain.Push(100);
  CHECK(after.insertion_mm == Approx(before.insertion_mm + 90 * kMmPerCount));
}

TEST_CASE("Malformed reports are counted and ignored") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  chain.Push(1000);
  const auto bytes = torquer::test::BytesOf(Next(chain.report));
  auto other_id = bytes;
  other_id[0] = 9;
  auto other_version = bytes;
  other_version[1] = 99;
  chain.device.SendBytes(std::span(bytes).first(31));
  chain.device.SendBytes(std::span(bytes).first(0));
  chain.device.SendBytes(other_id);
  chain.device.SendBytes(other_version);
  const instrument_command_t after = chain.Push(100);
  CHECK(after.insertion_mm == Approx(1000 * kMmPerCount));
  REQUIRE(chain.listener.Until([&] { return chain.listener.counters["reports_received"] == 24; }));
  CHECK(chain.listener.counters["reports_wrong_length"] == 2);
  CHECK(chain.listener.counters["reports_wrong_id"] == 1);
  CHECK(chain.listener.counters["reports_wrong_version"] == 1);
  CHECK(chain.listener.counters["reports_lost"] == 0);
}

TEST_CASE("Two daemons for one instrument or one device are refused") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  REQUIRE(chain.daemon->WaitForError("running"));
  const Ending same_instrument = EndingOf(SocketWords(chain.listener.folder.Path("other")));
  CHECK(same_instrument.status == 2);
  CHECK(Contains(same_instrument.error,
                 "the instrument 'guidewire' is in use by another torquer-daemon (process "));
  CHECK(Contains(same_instrument.error, "kill "));

  // This device answers a second host despite the first.
  chain.device.Unplug(/*stay_away=*/true);
  REQUIRE(chain.listener.UntilHealth("waiting for device", ""));
  SocketDevice generous(chain.socket);
  // The stopped daemon cannot take the connection, but it still holds its claim.
  chain.daemon->Signal(SIGSTOP);
  const Ending same_device =
      EndingOf(SocketWords(chain.socket, {"--uncalibrated", "--instrument", "catheter"}));
  chain.daemon->Signal(SIGCONT);
  CHECK(same_device.status == 2);
  CHECK(Contains(same_device.error, "the device 'SCRIPTED-1' is in use by another torquer-daemon"));
}

TEST_CASE("An instrument that already gets commands on the bus is left alone") {
  Listener listener;
  std::atomic<bool> stop = false;
  std::thread other([&] {
    torquer::bus::Bus bus;
    instrument_command_t command{};
    command.instrument = "guidewire";
    while (!stop) {
      bus.Publish(torquer::protocol::kInstrumentCommandChannel, command);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  const Ending ending = EndingOf(SocketWords(listener.folder.Path("device")));
  stop = true;
  other.join();
  CHECK(ending.status == 2);
  CHECK(Contains(ending.error, "the instrument 'guidewire' already gets commands on the bus"));
}

TEST_CASE("Firmware that does not fit is refused with the command that remedies it") {
  Listener listener;
  const std::string socket = listener.folder.Path("device");
  SocketDevice device(socket);
  std::string expected;
  SECTION("another protocol version") {
    device.identity.protocol_version = 2;
    expected = "firmware has protocol version 2, this program has 1";
  }
  SECTION("no identity at all") {
    device.stalls_identity = true;
    expected = "does not report its firmware version";
  }
  const Ending ending = EndingOf(SocketWords(socket));
  CAPTURE(ending.error);
  CHECK(ending.status == 2);
  CHECK(Contains(ending.error, expected));
  CHECK(Contains(ending.error, "torquer-flash"));
}

TEST_CASE("A device that returns with other firmware is waited for until it fits") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  const instrument_command_t before = chain.Push(1000);
  chain.device.Unplug(/*stay_away=*/true);
  REQUIRE(chain.listener.UntilHealth("waiting for device", "closed by the device"));
  chain.device.identity.protocol_version = 2;
  chain.device.Return();
  REQUIRE(chain.listener.UntilHealth("waiting for device", "firmware has protocol version 2"));
  chain.device.Unplug(/*stay_away=*/true);
  chain.device.identity.protocol_version = torquer::protocol::kProtocolVersion;
  chain.device.Return();
  REQUIRE(chain.listener.UntilHealth("running", "is connected again"));
  CHECK(chain.Push(100).insertion_mm == Approx(before.insertion_mm + 90 * kMmPerCount));
}

TEST_CASE("A calibration is tied to its device and its sensor resolution") {
  Listener listener;
  const std::string socket = listener.folder.Path("device");
  const std::string file = listener.folder.Path("calibration.toml");
  torquer::calibration::Calibration calibration =
      torquer::calibration::NominalCalibration("SCRIPTED-1", 1200);
  calibration.motion.per_count[0] = {0.5, 0.0};

  SECTION("the device's own") {
    SocketDevice device(socket);
    device.configuration.cpi = 800;
    torquer::calibration::WriteCalibration(calibration, file);
    ChildProcess daemon(SocketWords(socket, {"--calibration", file}));
    REQUIRE(daemon.WaitForError("running"));
    CHECK(device.configuration.cpi == 1200);
    InputReport report = StillReport();
    device.Send(report);
    report = Next(report);
    report.axial_counts = 10;
    device.Send(report);
    REQUIRE(listener.UntilCommands(2));
    CHECK(listener.commands[1].insertion_mm == 5.0);
    CHECK(listener.commands[1].flags == 0);
  }
  SECTION("another device's") {
    SocketDevice device(socket);
    calibration.device = "OTHER-2";
    torquer::calibration::WriteCalibration(calibration, file);
    const Ending ending = EndingOf(SocketWords(socket, {"--calibration", file}));
    CHECK(ending.status == 2);
    CHECK(Contains(ending.error, file + ": device = 'OTHER-2', but the device here is "
                                        "'SCRIPTED-1'"));
  }
  SECTION("a resolution that the device refuses") {
    SocketDevice device(socket);
    device.configuration.cpi = 800;
    device.stalls_settings = true;
    torquer::calibration::WriteCalibration(calibration, file);
    const Ending ending = EndingOf(SocketWords(socket, {"--calibration", file}));
    CHECK(ending.status == 2);
    CHECK(Contains(ending.error, "motion.cpi = 1200, but the device's sensor is set to 800"));
  }
  SECTION("an incomplete file") {
    torquer::calibration::WriteCalibration(calibration, file);
    std::filesystem::resize_file(file, std::filesystem::file_size(file) - 1);
    const Ending ending = EndingOf(SocketWords(socket, {"--calibration", file}));
    CHECK(ending.status == 2);
    CHECK(Contains(ending.error, file + ": incomplete"));
  }
  SECTION("the one kept under the device's serial number") {
    SocketDevice device(socket);
    setenv("XDG_CONFIG_HOME", listener.folder.Path().c_str(), 1);
    std::filesystem::create_directory(listener.folder.Path("torquer"));
    torquer::calibration::WriteCalibration(calibration,
                                           listener.folder.Path("torquer/SCRIPTED-1.toml"));
    ChildProcess daemon(SocketWords(socket, {}));
    REQUIRE(daemon.WaitForError("running"));
    InputReport report = StillReport();
    device.Send(report);
    report = Next(report);
    report.axial_counts = 10;
    device.Send(report);
    REQUIRE(listener.UntilCommands(2));
    CHECK(listener.commands[1].insertion_mm == 5.0);
    CHECK(listener.commands[1].flags == 0);
    unsetenv("XDG_CONFIG_HOME");
  }
  SECTION("no calibration under the device's serial number") {
    SocketDevice device(socket);
    setenv("XDG_CONFIG_HOME", listener.folder.Path().c_str(), 1);
    const Ending ending = EndingOf(SocketWords(socket, {}));
    unsetenv("XDG_CONFIG_HOME");
    CHECK(ending.status == 2);
    CHECK(Contains(ending.error, "/torquer/SCRIPTED-1.toml: cannot be read"));
    CHECK(Contains(ending.error, "torquer-calibrate, or run with --uncalibrated"));
  }
  SECTION("no file") {
    const Ending ending = EndingOf(SocketWords(socket, {"--calibration", file}));
    CHECK(ending.status == 2);
    CHECK(Contains(ending.error, file + ": cannot be read"));
  }
}

TEST_CASE("A bad command line is refused with the reason") {
  Listener listener;
  const std::string socket = listener.folder.Path("device");
  const auto [words, expected] = GENERATE_REF(table<std::vector<std::string>, std::string>({
      {{"--source", "socket", "--uncalibrated", "--calibration", "x"}, "exclude each other"},
      {{"--source", "socket", "--socket", "", "--uncalibrated"}, "--socket ''"},
      {{"--uncalibrated"}, "--source is missing; give usb, hidraw, evdev or socket"},
      {{"--source", "usb", "--device", "a", "--device", "b", "--uncalibrated"},
       "--source usb reads one device"},
      {{"--source", "pigeon", "--uncalibrated"},
       "--source 'pigeon': is not one of usb, hidraw, evdev, socket"},
      {{"--source", "socket", "--socket", socket, "--uncalibrated", "--lcm-url", "hello"},
       "LCM URL 'hello': the URL has no scheme"},
      {{"--source", "socket", "--socket", socket, "--uncalibrated", "--instrument", ""},
       "--instrument '': give the name of one of the scene's instruments"},
      {{"--sauce", "x"}, "unknown option '--sauce'; did you mean --source?"},
      {{"--source"}, "--source needs a value"},
      {{"--source", "socket", "--socket", socket, "--uncalibrated"}, "no device: none found at"},
  }));
  std::vector<std::string> line{torquer::test::kDaemonProgram};
  line.insert(line.end(), words.begin(), words.end());
  const Ending ending = EndingOf(line);
  CAPTURE(ending.error);
  CHECK(ending.status == 2);
  CHECK(Contains(ending.error, "torquer-daemon: "));
  CHECK(Contains(ending.error, expected));
}

TEST_CASE("SIGINT and SIGTERM end a daemon properly, also while it waits") {
  const int signal = GENERATE(SIGINT, SIGTERM);
  const bool plugged = GENERATE(true, false);
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  REQUIRE(chain.daemon->WaitForError("running"));
  if (!plugged) {
    chain.device.Unplug(/*stay_away=*/true);
    REQUIRE(chain.daemon->WaitForError("closed by the device"));
  }
  chain.daemon->Signal(signal);
  CHECK(chain.daemon->Wait() == 0);
  REQUIRE(chain.listener.UntilHealth("stopping", "asked to stop"));
}

TEST_CASE("A service manager is notified of the daemon's start, life, status and end") {
  Listener listener;
  const std::string name = listener.folder.Path("notify");
  const int manager = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  name.copy(address.sun_path, sizeof address.sun_path - 1);
  REQUIRE(bind(manager, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  const timeval patience{60, 0};
  setsockopt(manager, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  const auto hears = [manager](const std::string& begin) {
    char text[1000];
    for (;;) {
      const ssize_t size = recv(manager, text, sizeof text, 0);
      if (size < 0) return false;
      if (std::string(text, static_cast<std::size_t>(size)).rfind(begin, 0) == 0) return true;
    }
  };
  setenv("NOTIFY_SOCKET", name.c_str(), 1);
  setenv("WATCHDOG_USEC", "400000", 1);
  const std::string socket_path = listener.folder.Path("device");
  SocketDevice device(socket_path);
  const auto daemon = std::make_unique<ChildProcess>(SocketWords(socket_path));
  unsetenv("NOTIFY_SOCKET");
  unsetenv("WATCHDOG_USEC");
  CHECK(hears("READY=1"));
  CHECK(hears("STATUS=running: reading device SCRIPTED-1"));
  CHECK(hears("WATCHDOG=1"));
  CHECK(hears("WATCHDOG=1"));
  daemon->Signal(SIGTERM);
  CHECK(hears("STOPPING=1"));
  CHECK(daemon->Wait() == 0);
  close(manager);
}

TEST_CASE("The option --monitor shows the device's motion, and the last of it at the end") {
  Chain chain({"--uncalibrated", "--monitor"});
  REQUIRE(chain.device.WaitForHost());
  const instrument_command_t command = chain.Push(1200);
  CHECK(command.insertion_mm > 0);
  chain.daemon->Signal(SIGTERM);
  CHECK(chain.daemon->Wait() == 0);
  CAPTURE(chain.daemon->Output());
  CHECK(Contains(chain.daemon->Output(), "running: reading device SCRIPTED-1"));
  char place[40];
  std::snprintf(place, sizeof place, "%.2f mm", command.insertion_mm);
  CHECK(Contains(chain.daemon->Output(), place));
  CHECK(Contains(chain.daemon->Output(), "uncalibrated"));
}
