// torquer-emulator: the bench device in software.
#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "host/emulator/bench_choice.h"
#include "host/emulator/emulator_run.h"
#include "host/support/error_output.h"
#include "host/support/number.h"
#include "host/support/program.h"
#include "host/support/stop_signal.h"
#include "host/support/user_paths.h"

namespace {

using torquer::UsageError;
using torquer::ValueKind;
using torquer::emulator::Interval;
using torquer::emulator::RunOptions;
using torquer::emulator::RunSummary;

constexpr double kLongestS = 1e6;

Interval ParseInterval(const std::string& text) {
  const std::size_t colon = text.find(':');
  const auto number = [&](const std::string& part) {
    const std::optional<double> seconds = torquer::ParseNumber(part);
    if (!seconds || *seconds < 0 || *seconds > kLongestS) {
      throw UsageError("give start and duration in seconds (0 to 1000000 each), as in 2.5:0.3");
    }
    return *seconds;
  };
  if (colon == std::string::npos) number("");
  return {number(text.substr(0, colon)), number(text.substr(colon + 1))};
}

struct Arguments {
  RunOptions run;
  torquer::emulator::BenchChoice bench;
  std::string lcm_url;
  bool json = false;
};

void Declare(torquer::Options& options, Arguments& arguments) {
  RunOptions& run = arguments.run;
  const auto intervals = [&options](const std::string& name, std::vector<Interval>& list,
                                    const std::string& help) {
    options.Custom(name, "S:DURATION", help,
                   [&list](const std::string& text) { list.push_back(ParseInterval(text)); });
  };
  options.Group("Hand");
  options.Text(
      "--motion", "FILE", run.motion,
      "CSV file of the hand's motion with the columns time_s, insertion_mm, rotation_rad, "
      "joystick_x, joystick_y, buttons (and catheter_insertion_mm, catheter_rotation_rad for a "
      "second sensor); without it the hand follows TORQUER_HAND_MOTION on LCM",
      ValueKind::kFile);
  options.Number("--duration", "S", run.duration_s, 0, kLongestS,
                 "duration of the motion to run; without it the run ends with the file");
  options.Flag("--wait-client", run.wait_client, "start the motion when the first client connects");
  options.Flag("--fast", run.fast,
               "run as fast as the client accepts reports, instead of in real time");

  options.Group("Connections");
  options.Text("--socket", "PATH", run.socket,
               "path of the socket for torquer-daemon --source socket", ValueKind::kFile);
  options.Text("--lcm-url", "URL", arguments.lcm_url,
               "URL of the message bus; without it LCM_DEFAULT_URL, or else multicast on this "
               "machine; none: no bus");

  torquer::emulator::AddBenchOptions(options, arguments.bench);
  options.Text("--eeprom", "FILE", run.eeprom_file,
               "file with the device's EEPROM, which is kept between runs", ValueKind::kFile);
  options.Integer("--start-time-us", "T", arguments.bench.options.start_time_us, 0, 4294967295,
                  "device time at each start of the firmware");
  options.Number("--noise", "COUNTS", arguments.bench.options.sensor.noise_counts, 0, 1000,
                 "standard deviation of the noise in each reading during motion");
  options.Integer("--seed", "N", arguments.bench.options.seed, 0, 4294967295,
                  "seed of all random numbers");

  options.Group("Faults");
  options.Number("--drop", "P", run.drop_probability, 0, 1,
                 "probability that a report is lost on its way to the client");
  options.Number("--repeat", "P", run.repeat_probability, 0, 1,
                 "probability that a report is sent twice");
  intervals(
      "--lift-at", run.lifts,
      "interval in which the sensor is lifted, as start and duration in seconds of the motion");
  intervals("--raise-at", run.raises,
            "interval in which the hand raises the cylinder by its play (--play)");
  intervals("--fault-at", run.faults, "interval in which the sensor does not answer");
  intervals("--unplug-at", run.unplugs, "interval in which the device is unplugged");
  options.Numbers("--reset-at", "S", run.resets_s, 0, kLongestS,
                  "time at which the reset button is pressed");

  options.Group("Output");
  options.Flag("--json", arguments.json, "print the summary as one JSON object on the last line");
}

void Complete(Arguments& arguments) {
  RunOptions& run = arguments.run;
  arguments.bench.Complete();
  run.firmware = arguments.bench.firmware;
  run.bootloader = arguments.bench.bootloader;
  run.bench = arguments.bench.options;
  run.use_lcm = arguments.lcm_url != "none";
  if (run.use_lcm) run.lcm_url = arguments.lcm_url;
  if (run.motion.empty() && !run.use_lcm && !run.duration_s) {
    throw UsageError(
        "the run has neither motion nor end; give --motion FILE or --duration S, or leave out "
        "--lcm-url none");
  }
}

void PrintSummary(const RunSummary& summary, bool json) {
  if (json) {
    nlohmann::ordered_json object;
    object["reports_sent"] = summary.reports_sent;
    object["reports_dropped"] = summary.reports_dropped;
    object["reports_repeated"] = summary.reports_repeated;
    object["axial_counts"] = summary.axial_counts;
    object["transverse_counts"] = summary.transverse_counts;
    if (summary.catheter_axial_counts) {
      object["catheter_axial_counts"] = *summary.catheter_axial_counts;
      object["catheter_transverse_counts"] = *summary.catheter_transverse_counts;
    }
    object["violations"] = summary.violations;
    object["time_simulated_s"] = summary.time_simulated_s;
    object["cycles_used_fraction"] = summary.cycles_used_fraction;
    object["latest_frame_ms"] =
        summary.latest_frame_ms ? nlohmann::ordered_json(*summary.latest_frame_ms) : nullptr;
    object["serial"] = summary.serial;
    fmt::print("{}\n", object.dump());
  } else {
    fmt::print(
        "{} reports sent, {} dropped and {} repeated on their way; sensor at {}, {} counts; "
        "{:.1f} s simulated, CPU awake {:.1f} %\n",
        summary.reports_sent, summary.reports_dropped, summary.reports_repeated,
        summary.axial_counts, summary.transverse_counts, summary.time_simulated_s,
        summary.cycles_used_fraction * 100);
  }
  std::fflush(stdout);
  for (const std::string& text : summary.violation_texts) {
    torquer::PrintError("torquer-emulator: the firmware would fail on hardware: {}\n", text);
  }
}

int Run(Arguments& arguments) {
  Complete(arguments);
  const std::atomic<bool>& stop = torquer::StopOnSignal();
  torquer::emulator::EmulatorRun run(arguments.run);
  fmt::print("torquer-emulator: the device will listen at {}\n", run.socket_path());
  std::fflush(stdout);
  const RunSummary summary = run.Run(stop);
  PrintSummary(summary, arguments.json);
  return summary.violations == 0 ? torquer::kExitSuccess : torquer::kExitFailure;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program("torquer-emulator",
                           "Runs the firmware of the bench device with a virtual sensor, joystick "
                           "and buttons. It offers the device at a socket.");
  program.Note(
      "Exit status: 0 on success; 1 when the firmware violated a rule of the hardware; 2 when an "
      "option, a file or a port cannot be used.");
  Arguments arguments;
  arguments.run.socket = torquer::DefaultSocketPath();
  Declare(program.options(), arguments);
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
