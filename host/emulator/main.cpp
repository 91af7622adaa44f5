// torquer-emulator: the bench device without the bench.
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "host/emulator/session.h"
#include "host/support/command_line.h"
#include "host/support/error.h"

namespace {

using torquer::NumberIn;
using torquer::UserError;
using torquer::emulator::Interval;
using torquer::emulator::SessionOptions;
using torquer::emulator::SessionSummary;

constexpr char kUsage[] =
    "usage: torquer-emulator [--motion FILE] [--fast] [--wait-client] [--duration S] [--json]\n"
    "\n"
    "  --firmware ELF          image to run (else the one of this build)\n"
    "  --bootloader ELF        our bootloader before it, in the flash's last 2 KiB\n"
    "  --motion FILE           CSV: "
    "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons;\n"
    "                          without it the hand follows TORQUER_HAND_MOTION on LCM\n"
    "  --socket PATH           where the device listens (else $XDG_RUNTIME_DIR or /tmp)\n"
    "  --lcm-url URL|none      the bus (else LCM_DEFAULT_URL, else this machine's multicast)\n"
    "  --fast                  not in real time but as fast as the client takes the reports\n"
    "  --wait-client           the motion begins when a client has connected\n"
    "  --duration S            end after S seconds of motion (else at the end of the file)\n"
    "  --eeprom FILE           the device's EEPROM, kept from run to run\n"
    "  --serial TEXT           serial number in the EEPROM, up to 16 characters\n"
    "  --cylinder-radius-mm R  of the cylinder that the sensor looks at (5.0)\n"
    "  --start-time-us T       device time at each start, 0 .. 4294967295 (0)\n"
    "  --seed N                of all that is random (1)\n"
    "  --misalign_deg A        the sensor is mounted askew by A degrees\n"
    "  --scale F               the sensor counts F times as much as it should\n"
    "  --noise N               counts of noise in each moving reading, standard deviation\n"
    "  --drop P, --repeat P    share of reports lost, or sent twice, on their way to the client\n"
    "  --lift-at S:DURATION    the sensor is lifted; times in seconds of the motion,\n"
    "  --fault-at S:DURATION   the sensor does not answer;\n"
    "  --unplug-at S:DURATION  the device is unplugged;\n"
    "  --reset-at S            the reset button is pressed; each may be given several times\n"
    "  --json                  the summary as one JSON object on the last line\n";

volatile std::sig_atomic_t stop_requested = 0;
void RequestStop(int) { stop_requested = 1; }

Interval ParseInterval(const std::string& option, const std::string& text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) {
    throw UserError(option + " '" + text + "': give start and duration in seconds, as in 2.5:0.3");
  }
  return {NumberIn(option, text.substr(0, colon), 0, 1e6),
          NumberIn(option, text.substr(colon + 1), 0, 1e6)};
}

struct Arguments {
  SessionOptions session;
  bool json = false;
  bool help = false;
};

Arguments Parse(int argc, char** argv) {
  Arguments arguments;
  SessionOptions& session = arguments.session;
  std::string lcm_url;
  torquer::CommandLine line;
  const auto number = [&line](const std::string& name, double low, double high, double& value) {
    line.Option(name, [name, low, high, &value](const std::string& text) {
      value = NumberIn(name, text, low, high);
    });
  };
  const auto intervals = [&line](const std::string& name, std::vector<Interval>& list) {
    line.Option(name, [name, &list](const std::string& text) {
      list.push_back(ParseInterval(name, text));
    });
  };
  line.Option("--firmware", session.firmware);
  line.Option("--bootloader", session.bootloader);
  line.Option("--motion", session.motion);
  line.Option("--socket", session.socket);
  line.Option("--lcm-url", lcm_url);
  line.Flag("--fast", session.fast);
  line.Flag("--wait-client", session.wait_client);
  line.Option("--duration", [&session](const std::string& text) {
    session.duration_s = NumberIn("--duration", text, 0, 1e6);
  });
  line.Option("--eeprom", session.eeprom_file);
  line.Option("--serial", session.bench.serial);
  number("--cylinder-radius-mm", 0.1, 1000, session.bench.cylinder_radius_mm);
  line.Option("--start-time-us", [&session](const std::string& text) {
    session.bench.start_time_us =
        static_cast<std::uint32_t>(NumberIn("--start-time-us", text, 0, 4294967295.0));
  });
  line.Option("--seed", [&session](const std::string& text) {
    session.bench.seed = static_cast<std::uint32_t>(NumberIn("--seed", text, 0, 4294967295.0));
  });
  line.Option("--misalign_deg", [&session](const std::string& text) {
    session.bench.sensor.misalignment_rad =
        NumberIn("--misalign_deg", text, -180, 180) * std::numbers::pi / 180;
  });
  number("--scale", 0.01, 100, session.bench.sensor.scale);
  number("--noise", 0, 1000, session.bench.sensor.noise_counts);
  number("--drop", 0, 1, session.drop_probability);
  number("--repeat", 0, 1, session.repeat_probability);
  intervals("--lift-at", session.lifts);
  intervals("--fault-at", session.faults);
  intervals("--unplug-at", session.unplugs);
  line.Option("--reset-at", [&session](const std::string& text) {
    session.resets_s.push_back(NumberIn("--reset-at", text, 0, 1e6));
  });
  line.Flag("--json", arguments.json);
  line.Flag("--help", arguments.help);
  line.Parse(argc, argv, kUsage);

  session.use_lcm = lcm_url != "none";
  if (session.use_lcm) session.lcm_url = lcm_url;
  if (session.socket.empty()) session.socket = torquer::emulator::DefaultSocketPath();
  if (session.firmware.empty()) {
    session.firmware = torquer::emulator::FirmwareImage::OfThisBuild();
  }
  if (session.motion.empty() && !session.use_lcm && !session.duration_s) {
    throw UserError(
        "nothing moves the hand and nothing ends the run: give --motion FILE, or "
        "--duration S, or leave out --lcm-url none");
  }
  return arguments;
}

void PrintSummary(const SessionSummary& summary, bool json) {
  if (json) {
    nlohmann::ordered_json object;
    object["reports_sent"] = summary.reports_sent;
    object["reports_dropped"] = summary.reports_dropped;
    object["reports_repeated"] = summary.reports_repeated;
    object["axial_counts"] = summary.axial_counts;
    object["transverse_counts"] = summary.transverse_counts;
    object["violations"] = summary.violations;
    object["time_simulated_s"] = summary.time_simulated_s;
    object["cycles_used_fraction"] = summary.cycles_used_fraction;
    object["latest_frame_ms"] = summary.latest_frame_ms;
    object["serial"] = summary.serial;
    std::printf("%s\n", object.dump().c_str());
  } else {
    std::printf(
        "%lld reports sent, %lld dropped and %lld repeated on their way; "
        "sensor at %lld, %lld counts; %.1f s simulated, CPU awake %.1f %%\n",
        static_cast<long long>(summary.reports_sent),
        static_cast<long long>(summary.reports_dropped),
        static_cast<long long>(summary.reports_repeated),
        static_cast<long long>(summary.axial_counts),
        static_cast<long long>(summary.transverse_counts), summary.time_simulated_s,
        summary.cycles_used_fraction * 100);
  }
  std::fflush(stdout);
  for (const std::string& text : summary.violation_texts) {
    std::fprintf(stderr, "torquer-emulator: the firmware would fail on hardware: %s\n",
                 text.c_str());
  }
}

int Main(int argc, char** argv) {
  const Arguments arguments = Parse(argc, argv);
  if (arguments.help) {
    std::printf("%s", kUsage);
    return 0;
  }
  struct sigaction action {};
  action.sa_handler = &RequestStop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);

  torquer::emulator::Session session(arguments.session);
  std::printf("torquer-emulator: the device will listen at %s\n", session.socket_path().c_str());
  std::fflush(stdout);
  const SessionSummary summary = session.Run(stop_requested);
  PrintSummary(summary, arguments.json);
  return summary.violations == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Main(argc, argv);
  } catch (const UserError& error) {
    std::fprintf(stderr, "torquer-emulator: %s\n", error.what());
    return torquer::kExitUserError;
  }
}
