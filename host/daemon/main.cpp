// torquer-daemon: reads the reports of a bench device and publishes commands for an instrument.

#include <fmt/format.h>
#include <pthread.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>

#include "calibration/calibration_file.h"
#include "host/daemon/claim.h"
#include "host/daemon/daemon.h"
#include "host/daemon/device_list.h"
#include "host/daemon/device_monitor.h"
#include "host/daemon/uinput_device.h"
#include "host/device/source_choice.h"
#include "host/support/program.h"
#include "host/support/realtime.h"
#include "protocol/lcm_channels.h"

namespace {

using torquer::UsageError;
using torquer::UserError;

struct Arguments {
  torquer::device::SourceChoice source;
  std::string calibration;
  bool uncalibrated = false;
  std::string lcm_url;
  std::string instrument = torquer::protocol::kGuidewire;
  std::string second_instrument;
  bool json = false;
  bool monitor = false;
  bool uinput = false;
  bool realtime = false;
  bool list = false;
  bool home = false;
};

void Declare(torquer::Options& options, Arguments& arguments) {
  torquer::device::AddSourceOptions(options, arguments.source);
  options.Group("Calibration");
  options.Text("--calibration", "FILE", arguments.calibration,
               "calibration file of the device; without it the file that torquer-calibrate keeps "
               "for the serial number",
               torquer::ValueKind::kFile);
  options.Flag("--uncalibrated", arguments.uncalibrated,
               "use nominal gains instead of a calibration; every published command is marked as "
               "uncalibrated");
  options.Group("Bus");
  options.Text("--instrument", "NAME", arguments.instrument,
               "name of the instrument in the scene that the device drives");
  options.Text("--second-instrument", "NAME", arguments.second_instrument,
               "name of the instrument that the second sensor of the box drives, such as catheter; "
               "its calibration is found by the serial number of the box with .2 added");
  options.Text(
      "--lcm-url", "URL", arguments.lcm_url,
      "URL of the message bus; without it LCM_DEFAULT_URL, or else multicast on this machine");
  options.Flag(
      "--realtime", arguments.realtime,
      "run with real-time priority, before all ordinary programs, and lock the memory in RAM");
  options.Group("Output");
  options.Flag("--monitor", arguments.monitor,
               "show the motion of the device as live bars in the terminal");
  options.Flag("--uinput", arguments.uinput,
               "also create an input device on this machine, which gives insertion, rotation, "
               "joystick and buttons to other software");
  options.Flag("--json", arguments.json, "print statistics as one JSON object at the end");
  options.Group("Actions instead of running");
  options.Flag(
      "--list", arguments.list,
      "list the devices of this machine with serial number, firmware, path, calibration and user");
  options.Flag("--home", arguments.home,
               "set the present position of the running daemon's instrument as its start position");
}

sigset_t HandledSignals() {
  sigset_t signals{};
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) sigaddset(&signals, signal);
  return signals;
}

// Turns signals into calls of the daemon during its lifetime. The signals must have been blocked
// before the first thread was created, so that no other thread receives them.
class SignalThread {
 public:
  SignalThread(torquer::daemon::Daemon& daemon, torquer::daemon::Daemon* beside)
      : thread_([this, &daemon, beside] { Serve(daemon, beside); }) {}
  ~SignalThread() {
    done_ = true;
    pthread_kill(thread_.native_handle(), SIGUSR1);
    thread_.join();
  }
  SignalThread(const SignalThread&) = delete;
  SignalThread& operator=(const SignalThread&) = delete;

 private:
  void Serve(torquer::daemon::Daemon& daemon, torquer::daemon::Daemon* beside) {
    const sigset_t signals = HandledSignals();
    for (int signal = 0; sigwait(&signals, &signal) == 0 && !done_;) {
      if (signal == SIGUSR1) {
        daemon.Home();
        if (beside != nullptr) beside->Home();
      } else {
        daemon.Stop();
      }
    }
  }

  std::atomic<bool> done_ = false;
  std::thread thread_;
};

nlohmann::ordered_json StatisticsOf(const torquer::daemon::Daemon& daemon) {
  const torquer::daemon::Statistics& statistics = daemon.statistics();
  nlohmann::ordered_json object;
  const auto add = [&object](const std::string& name, std::optional<std::int64_t> value) {
    object[name] = value ? nlohmann::ordered_json(*value) : nullptr;
  };
  for (const auto& [name, value] : daemon.Counters()) add(name, value);
  add("report_to_command_p50_us", statistics.QuantileUs(0.5));
  add("report_to_command_max_us", statistics.max_us());
  object["cpu_percent_of_core"] = statistics.CpuPercent();
  object["wall_s"] = statistics.WallSeconds();
  return object;
}

int SendHome(const Arguments& arguments) {
  if (!torquer::bus::SignalClaimHolder(
          torquer::daemon::InstrumentClaimName(arguments.instrument, arguments.lcm_url), SIGUSR1)) {
    throw UserError(
        fmt::format("no torquer-daemon of this user drives the instrument '{}' on this bus; give "
                    "the --instrument and --lcm-url of the running daemon",
                    arguments.instrument));
  }
  return torquer::kExitSuccess;
}

void CheckTogether(const Arguments& arguments) {
  if (arguments.instrument.empty()) {
    throw UsageError("--instrument '': give the name of one of the scene's instruments");
  }
  if (!arguments.calibration.empty() && arguments.uncalibrated) {
    throw UsageError("--calibration and --uncalibrated exclude each other; give one");
  }
  if (arguments.second_instrument.empty()) return;
  if (arguments.source.sensor != 1) {
    throw UsageError("--second-instrument and --sensor 2 exclude each other; give one");
  }
  if (arguments.source.is_mouse()) {
    throw UsageError("--second-instrument: --source evdev has one sensor; start a second daemon");
  }
  if (!arguments.calibration.empty()) {
    throw UsageError(
        "--calibration is of one sensor; with --second-instrument leave it out, and both files are "
        "found by the serial number");
  }
}

// Daemon of the second sensor, whose reports come through `first`.
std::unique_ptr<torquer::daemon::Daemon> MakeSecond(const Arguments& arguments,
                                                    torquer::bus::Bus& bus,
                                                    torquer::device::SensorView& first) {
  if (arguments.second_instrument.empty()) return nullptr;
  torquer::daemon::DaemonOptions options;
  options.instrument = arguments.second_instrument;
  options.calibration_by_serial = !arguments.uncalibrated;
  return std::make_unique<torquer::daemon::Daemon>(
      std::move(options), bus, std::make_unique<torquer::device::SensorView>(&first));
}

int RunDaemon(const Arguments& arguments) {
  CheckTogether(arguments);
  torquer::daemon::DaemonOptions options;
  options.instrument = arguments.instrument;
  options.calibration_by_serial = !arguments.uncalibrated && arguments.calibration.empty();
  if (!arguments.calibration.empty()) {
    options.calibration_path = arguments.calibration;
    options.calibration = torquer::calibration::ReadCalibration(arguments.calibration);
  }
  // The threads that libusb and LCM start inherit this signal mask.
  const sigset_t signals = HandledSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::unique_ptr<torquer::device::SensorView> source =
      torquer::device::OpenSource(arguments.source);
  torquer::device::SensorView& first = *source;
  options.second_sensor_used = !arguments.second_instrument.empty();
  std::optional<torquer::daemon::DeviceMonitor> monitor;
  if (arguments.monitor) {
    monitor.emplace();
    options.observe = [&monitor](const std::string& device, const auto& output) {
      monitor->Add(device, output);
    };
    options.announce = [&monitor](const std::string& text) { monitor->Print(text); };
  }
  std::optional<torquer::daemon::UinputDevice> uinput;
  if (arguments.uinput) {
    uinput.emplace("Torquer " + arguments.instrument);
    options.show = [&uinput](const torquer::daemon::HandState& hand) { uinput->Show(hand); };
  }
  if (arguments.realtime)
    torquer::EnterRealtime();  // before the bus, so that its thread is included
  torquer::bus::Bus bus(arguments.lcm_url);
  torquer::daemon::Daemon daemon(std::move(options), bus, std::move(source));
  const std::unique_ptr<torquer::daemon::Daemon> beside = MakeSecond(arguments, bus, first);
  const SignalThread signal_thread(daemon, beside.get());
  daemon.Run(beside.get());
  monitor.reset();  // draws the last state
  if (arguments.json) {
    nlohmann::ordered_json statistics = StatisticsOf(daemon);
    if (beside) statistics["second"] = StatisticsOf(*beside);
    fmt::print("{}\n", statistics.dump());
  }
  return torquer::kExitSuccess;
}

int Run(const Arguments& arguments) {
  if (arguments.list) {
    fmt::print("{}", torquer::daemon::DeviceList());
    return torquer::kExitSuccess;
  }
  return arguments.home ? SendHome(arguments) : RunDaemon(arguments);
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "torquer-daemon",
      "Reads a bench device and publishes the commanded position of its instrument on the bus, "
      "until SIGINT or SIGTERM. SIGUSR1 has the effect of --home.");
  program.Note(
      "Exit status: 0 on success; 2 when an option, a file, a device or the bus cannot be used.");
  Arguments arguments;
  Declare(program.options(), arguments);
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
