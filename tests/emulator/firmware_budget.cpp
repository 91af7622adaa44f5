// Firmware budget: flash, RAM, stack, cycles and lost reports. It is measured on the images
// themselves while a hand moves at 1 m/s. Exits with 1 if a limit is exceeded.
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware/board/atmega32u4/setup.h"
#include "host/emulator/bench_device.h"
#include "host/emulator/usb_host.h"
#include "host/support/program.h"
#include "protocol/firmware_image.h"
#include "protocol/hid_reports.h"
#include "tests/support/paths.h"
#include "tests/support/reports.h"

namespace {

using namespace torquer;
using namespace torquer::emulator;

// ATmega32U4 memory; 4 KiB of flash are reserved for a bootloader.
constexpr int kFlashBytes = protocol::kImageTrailerAddress;
constexpr int kRamStart = 0x100, kRamEnd = 0xb00;
constexpr int kRamBytes = kRamEnd - kRamStart;
constexpr double kCyclesLimit = 0.6;
constexpr int kStackReserve = 512;
constexpr double kAwakeLimitUs = 800;  // in any frame: real silicon has a fifth in reserve
constexpr int kFramesARequest = 50;
constexpr double kSpeed_mm_s = 1000;
constexpr double kRest_s = 0.6;  // two sensors take turns at their start, too

struct Budget {
  std::string image;
  int cpu_mhz = 0;
  int flash_bytes = 0;
  int variables_bytes = 0;
  int stack_bytes = 0;
  int longest_frame_us = 0;
  int longest_awake_us = 0;  // in one frame, except start-up
  double cycles_fraction = 0;
  long long frames = 0;
  long long reports = 0;
  long long lost = 0;
  long long axial_counts = 0;
  long long count_error = 0;  // between sensor and report, and between hand and sensor
  long long violations = 0;
  bool within = false;
};

void Ask(UsbHost& host, long long number) {
  const protocol::ConfigurationReport configuration =
      test::ConfigurationOf(1200, static_cast<int>(10 + number % 16));
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&configuration);
  host.SubmitSetFeature({bytes, bytes + sizeof(configuration)}, {});
  host.SubmitGetFeature(protocol::kIdentityReportId, {});
}

Budget Measure(const std::string& name, double seconds) {
  const FirmwareImage image(torquer::test::FirmwarePath(name + ".elf"));
  BenchOptions options;
  options.start_time_us = 0xffffffffu - 2000000u;  // device time wraps during the run
  BenchDevice device(image, options);
  device.SetHand([seconds](double time_s) {
    HandState hand;
    hand.insertion_mm = kSpeed_mm_s * std::clamp(time_s - kRest_s, 0.0, seconds);
    hand.rotation_rad = -hand.insertion_mm / 200;
    hand.catheter_insertion_mm = -hand.insertion_mm;
    hand.catheter_rotation_rad = hand.insertion_mm / 300;
    return hand;
  });
  UsbHost host(device);
  Budget budget;
  protocol::InputReport last{}, second{};  // of each sensor
  host.wants_input = [] { return true; };
  host.on_input = [&](const std::vector<std::uint8_t>& packet) {
    protocol::InputReport report;
    std::memcpy(&report, packet.data(), sizeof(report));
    protocol::InputReport& before = report.report_id == protocol::kInputReportId ? last : second;
    ++budget.reports;
    if (before.report_id != 0) {
      budget.lost += static_cast<std::uint16_t>(report.sequence - before.sequence - 1);
    }
    before = report;
  };
  if (!host.RunUntilReady()) throw std::runtime_error(name + ": not enumerated");
  const double end_us = (kRest_s + seconds + 0.1) * 1e6;
  std::uint64_t awake_cycles = 0;
  for (; device.now_us() < end_us; ++budget.frames) {
    // Peak load: a setting changes and is written to the EEPROM while the host requests reports.
    if (budget.frames % kFramesARequest == 0) Ask(host, budget.frames / kFramesARequest);
    host.RunFrame();
    const std::uint64_t now = device.chip().cycles() - device.chip().sleep_cycles();
    const double awake_us = static_cast<double>(now - awake_cycles) / (image.cpu_hz() / 1e6);
    awake_cycles = now;
    if (budget.frames > 0) {
      budget.longest_awake_us = std::max(budget.longest_awake_us, static_cast<int>(awake_us + 1));
    }
  }

  const ControlResult answer = host.GetFeature(protocol::kDiagnosticsReportId);
  protocol::DiagnosticsReport diagnostics{};
  std::memcpy(&diagnostics, answer.data.data(), std::min(sizeof(diagnostics), answer.data.size()));
  budget.image = name;
  budget.cpu_mhz = static_cast<int>(image.cpu_hz() / 1000000);
  protocol::ImageTrailer trailer;
  std::memcpy(&trailer, &image.flash()[protocol::kImageTrailerAddress], sizeof(trailer));
  budget.flash_bytes = trailer.length;
  budget.variables_bytes = static_cast<int>(image.Symbol("_end") - image.Symbol("__data_start"));
  budget.stack_bytes = kRamEnd - board::kStackLimitAddress - diagnostics.stack_headroom;
  budget.longest_frame_us = diagnostics.longest_frame_us;
  budget.cycles_fraction = device.CyclesUsedFraction();
  budget.lost += diagnostics.frames_missed;
  budget.axial_counts = device.sensor().axial_counts();
  const auto wrapped = [](long long counts) { return static_cast<std::int32_t>(counts); };
  const long long nominal = std::llround(kSpeed_mm_s * seconds / 25.4 * last.cpi);
  budget.count_error =
      std::llabs(last.axial_counts - wrapped(budget.axial_counts)) +
      std::llabs(last.transverse_counts - wrapped(device.sensor().transverse_counts())) +
      std::llabs(budget.axial_counts - nominal);
  if (const VirtualPmw3360* sensor = device.second_sensor(); sensor != nullptr) {
    budget.count_error +=
        std::llabs(second.axial_counts - wrapped(sensor->axial_counts())) +
        std::llabs(second.transverse_counts - wrapped(sensor->transverse_counts())) +
        std::llabs(sensor->axial_counts() + nominal);
  }
  budget.violations = device.violation_count();
  budget.within =
      budget.flash_bytes <= kFlashBytes &&
      kRamStart + budget.variables_bytes <= board::kWarmRecordAddress &&
      diagnostics.stack_headroom >= kStackReserve && budget.cycles_fraction < kCyclesLimit &&
      budget.longest_awake_us < kAwakeLimitUs && budget.lost == 0 && budget.count_error == 0 &&
      budget.violations == 0 && budget.reports >= budget.frames - 1;
  return budget;
}

void PrintText(const Budget& budget) {
  std::printf(
      "%s, %d MHz: flash %d of %d bytes, variables %d and stack %d of %d bytes of RAM,\n"
      "  CPU awake %.1f %% and at most %d us in a frame, frame to queued report at most %d us,\n"
      "  %lld reports in %lld frames, %lld lost, %lld counts, count error %lld, "
      "%lld violations of timing: %s\n",
      budget.image.c_str(), budget.cpu_mhz, budget.flash_bytes, kFlashBytes, budget.variables_bytes,
      budget.stack_bytes, kRamBytes, budget.cycles_fraction * 100, budget.longest_awake_us,
      budget.longest_frame_us, budget.reports, budget.frames, budget.lost, budget.axial_counts,
      budget.count_error, budget.violations,
      budget.within ? "within the limits" : "LIMIT EXCEEDED");
}

void PrintJson(const Budget& budget) {
  nlohmann::ordered_json object;
  object["image"] = budget.image;
  object["cpu_mhz"] = budget.cpu_mhz;
  object["flash_bytes"] = budget.flash_bytes;
  object["variables_bytes"] = budget.variables_bytes;
  object["stack_bytes"] = budget.stack_bytes;
  object["longest_frame_us"] = budget.longest_frame_us;
  object["cycles_fraction"] = budget.cycles_fraction;
  object["longest_awake_us"] = budget.longest_awake_us;
  object["frames"] = budget.frames;
  object["reports"] = budget.reports;
  object["lost"] = budget.lost;
  object["axial_counts"] = budget.axial_counts;
  object["count_error"] = budget.count_error;
  object["violations"] = budget.violations;
  object["within"] = budget.within;
  std::printf("%s\n", object.dump().c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Program program("firmware_budget",
                  "Measures what the firmware costs and whether it keeps up: flash, RAM, stack, "
                  "cycles, lost reports, on the images themselves, while a hand moves at 1 m/s.");
  program.Note("Exit status: 0, or 1 when a limit is exceeded. 3600 s take a few minutes.");
  double seconds = 10;
  bool json = false;
  program.options().Number("--seconds", "S", seconds, 0.001, 1e5, "time to simulate");
  program.options().Flag("--json", json, "print one JSON object for each image");
  return program.Main(argc, argv, [&] {
    bool within = true;
    for (const char* name :
         {"torquer-firmware", "torquer-firmware-8mhz", "torquer-firmware-16to8mhz",
          "torquer-firmware-two-sensors", "torquer-firmware-two-sensors-8mhz",
          "torquer-firmware-two-sensors-16to8mhz"}) {
      const Budget budget = Measure(name, seconds);
      json ? PrintJson(budget) : PrintText(budget);
      std::fflush(stdout);
      within = within && budget.within;
    }
    return within ? kExitSuccess : kExitFailure;
  });
}
