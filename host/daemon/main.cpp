// torquer-daemon: a bench device's reports in, an instrument's commands out.

#include <pthread.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "calibration/calibration_file.h"
#include "host/daemon/claim.h"
#include "host/daemon/daemon.h"
#include "host/daemon/device_list.h"
#include "host/daemon/device_monitor.h"
#include "host/device/evdev_source.h"
#include "host/device/socket_source.h"
#include "host/device/usb_source.h"
#include "host/support/command_line.h"
#include "host/support/error.h"
#include "protocol/lcm_channels.h"

namespace {

using torquer::UserError;

constexpr char kUsage[] =
    "usage: torquer-daemon --source usb|evdev|socket [--device SERIAL|PATH].. [--socket PATH]\n"
    "         [--calibration FILE | --uncalibrated] [--lcm-url URL] [--instrument NAME] [--json]\n"
    "         [--monitor]\n"
    "       torquer-daemon --list\n"
    "       torquer-daemon --home [--lcm-url URL] [--instrument NAME]\n"
    "\n"
    "  --source usb       the bench device; --device picks one by serial number\n"
    "  --source evdev     a mouse and a joystick, each given by --device /dev/input/..\n"
    "  --source socket    the emulator that listens at --socket\n"
    "  --calibration      another file than the one that torquer-calibrate kept for the device\n"
    "  --uncalibrated     nominal gains; every command says so\n"
    "  --lcm-url          the bus (else LCM_DEFAULT_URL, else this machine's multicast)\n"
    "  --instrument       guidewire (as without) or catheter\n"
    "  --monitor          the device's motion as live bars in the terminal\n"
    "  --json             statistics as one JSON object when it ends\n"
    "  --list             the devices of this machine: serial, firmware, path, calibration\n"
    "  --home             tell the running daemon that the instrument is at its start now\n";

struct Arguments {
  std::string source;
  std::vector<std::string> devices;
  std::string socket;
  std::string calibration;
  bool uncalibrated = false;
  std::string lcm_url;
  std::string instrument = torquer::protocol::kGuidewire;
  bool json = false;
  bool monitor = false;
  bool list = false;
  bool home = false;
  bool help = false;
};

Arguments Parse(int argc, char** argv) {
  Arguments arguments;
  torquer::CommandLine line;
  line.Option("--source", arguments.source);
  line.Option("--device", [&](const std::string& name) { arguments.devices.push_back(name); });
  line.Option("--socket", arguments.socket);
  line.Option("--calibration", arguments.calibration);
  line.Flag("--uncalibrated", arguments.uncalibrated);
  line.Option("--lcm-url", arguments.lcm_url);
  line.Option("--instrument", arguments.instrument);
  line.Flag("--json", arguments.json);
  line.Flag("--monitor", arguments.monitor);
  line.Flag("--list", arguments.list);
  line.Flag("--home", arguments.home);
  line.Flag("--help", arguments.help);
  line.Parse(argc, argv, kUsage);
  if (arguments.instrument != torquer::protocol::kGuidewire &&
      arguments.instrument != torquer::protocol::kCatheter) {
    throw UserError("--instrument '" + arguments.instrument +
                    "' is not known; there are guidewire and catheter");
  }
  if (arguments.help || arguments.list || arguments.home) return arguments;
  if (!arguments.calibration.empty() && arguments.uncalibrated) {
    throw UserError("--calibration and --uncalibrated exclude each other; give one");
  }
  return arguments;
}

std::unique_ptr<torquer::device::ReportSource> MakeSource(const Arguments& arguments) {
  if (arguments.source == "socket") {
    return std::make_unique<torquer::device::SocketSource>(arguments.socket);
  }
  if (arguments.source == "usb") {
    if (arguments.devices.size() > 1) {
      throw UserError("--source usb reads one device; give --device once, with its serial number");
    }
    return std::make_unique<torquer::device::UsbSource>(
        arguments.devices.empty() ? "" : arguments.devices.front());
  }
  if (arguments.source == "evdev") {
    return std::make_unique<torquer::device::EvdevSource>(arguments.devices);
  }
  throw UserError("--source '" + arguments.source + "' is not known\n" + kUsage);
}

sigset_t HandledSignals() {
  sigset_t signals{};
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) sigaddset(&signals, signal);
  return signals;
}

// Turns signals into calls while it lives. They must have been blocked before the first thread was
// made, so that no other thread takes them.
class SignalThread {
 public:
  explicit SignalThread(torquer::daemon::Daemon& daemon)
      : thread_([this, &daemon] { Serve(daemon); }) {}
  ~SignalThread() {
    done_ = true;
    pthread_kill(thread_.native_handle(), SIGUSR1);
    thread_.join();
  }
  SignalThread(const SignalThread&) = delete;
  SignalThread& operator=(const SignalThread&) = delete;

 private:
  void Serve(torquer::daemon::Daemon& daemon) {
    const sigset_t signals = HandledSignals();
    for (int signal = 0; sigwait(&signals, &signal) == 0 && !done_;) {
      if (signal == SIGUSR1) {
        daemon.Home();
      } else {
        daemon.Stop();
      }
    }
  }

  std::atomic<bool> done_ = false;
  std::thread thread_;
};

void PrintStatistics(const torquer::daemon::Daemon& daemon) {
  const torquer::daemon::Statistics& statistics = daemon.statistics();
  nlohmann::ordered_json object;
  for (const auto& [name, value] : daemon.Counters()) object[name] = value;
  object["report_to_command_p50_us"] = statistics.QuantileUs(0.5);
  object["report_to_command_p99_us"] = statistics.QuantileUs(0.99);
  object["report_to_command_max_us"] = statistics.max_us();
  object["cpu_percent_of_core"] = statistics.CpuPercent();
  object["wall_s"] = statistics.WallSeconds();
  std::printf("%s\n", object.dump().c_str());
}

int SendHome(const Arguments& arguments) {
  const auto holder = torquer::daemon::ClaimHolder(
      torquer::daemon::InstrumentClaimName(arguments.instrument, arguments.lcm_url));
  if (!holder || kill(*holder, SIGUSR1) != 0) {
    throw UserError("no torquer-daemon of yours drives the instrument '" + arguments.instrument +
                    "' on this bus; give the --instrument and --lcm-url that it was started with");
  }
  return 0;
}

int RunDaemon(const Arguments& arguments) {
  torquer::daemon::DaemonOptions options;
  options.instrument = arguments.instrument;
  options.calibration_by_serial = !arguments.uncalibrated && arguments.calibration.empty();
  if (!arguments.calibration.empty()) {
    options.calibration_path = arguments.calibration;
    options.calibration = torquer::calibration::ReadCalibration(arguments.calibration);
  }
  // libusb and LCM start threads of their own, which inherit this.
  const sigset_t signals = HandledSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::unique_ptr<torquer::device::ReportSource> source = MakeSource(arguments);
  std::optional<torquer::daemon::DeviceMonitor> monitor;
  if (arguments.monitor) {
    monitor.emplace();
    options.observe = [&monitor](const std::string& device, const auto& output) {
      monitor->Add(device, output);
    };
    options.tell = [&monitor](const std::string& text) { monitor->Say(text); };
  }
  torquer::bus::Bus bus(arguments.lcm_url);
  torquer::daemon::Daemon daemon(std::move(options), bus, std::move(source));
  const SignalThread signal_thread(daemon);
  daemon.Run();
  monitor.reset();  // shows the last of it
  if (arguments.json) PrintStatistics(daemon);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Arguments arguments = Parse(argc, argv);
    if (arguments.help) {
      std::fputs(kUsage, stdout);
      return 0;
    }
    if (arguments.list) {
      std::fputs(torquer::daemon::DeviceList().c_str(), stdout);
      return 0;
    }
    return arguments.home ? SendHome(arguments) : RunDaemon(arguments);
  } catch (const UserError& error) {
    std::fprintf(stderr, "torquer-daemon: %s\n", error.what());
    return torquer::kExitUserError;
  }
}
