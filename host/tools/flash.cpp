// torquer-flash: installs firmware on a bench device in any state.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <sstream>
#include <string>
#include <utility>

#include "host/support/error_output.h"
#include "host/support/installed.h"
#include "host/support/program.h"
#include "host/support/stop_signal.h"
#include "host/tools/caterina.h"
#include "host/tools/flash_procedure.h"
#include "host/tools/fuses.h"
#include "host/tools/usb_boards.h"
#include "protocol/hid_reports.h"

namespace {

using torquer::tools::FlashImage;
using torquer::tools::FlashRequest;

// Progress bar on one line, if standard output is a terminal.
class ProgressBar {
 public:
  ~ProgressBar() { Break(); }
  ProgressBar() = default;
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void Show(const std::string& what, int done, int total) {
    if (isatty(STDOUT_FILENO) == 0) return;
    constexpr int kWidth = 40;
    const int filled = kWidth * done / total;
    fmt::print("\r{:<10} [{:#<{}}{:{}}] {:3} %{}", what, "", filled, "", kWidth - filled,
               100 * done / total, done == total ? "\n" : "");
    std::fflush(stdout);
    open_ = done != total;
  }

 private:
  // Ends an incomplete line.
  void Break() {
    if (open_) fmt::print("\n");
    std::fflush(stdout);
    open_ = false;
  }

  bool open_ = false;
};

const char* GoodOr(bool good, const char* otherwise) { return good ? "good" : otherwise; }

struct Arguments {
  FlashRequest request;
  std::string srom;
  std::string closed_at_rest;
  std::string programmer;
};

// Button bits of the names in --closed-at-rest.
std::uint8_t ContactsNamed(const std::string& names) {
  using torquer::protocol::Button;
  constexpr std::pair<const char*, Button> kContacts[] = {
      {"xray", torquer::protocol::kButtonXray},
      {"contrast", torquer::protocol::kButtonContrast},
      {"clutch", torquer::protocol::kButtonClutch}};
  std::uint8_t buttons = 0;
  if (names == "none") return buttons;
  std::stringstream stream(names);
  for (std::string name; std::getline(stream, name, '+');) {
    const auto* const found =
        std::find_if(std::begin(kContacts), std::end(kContacts),
                     [&name](const auto& contact) { return name == contact.first; });
    if (found == std::end(kContacts)) {
      throw torquer::UsageError(
          fmt::format("--closed-at-rest {}: contact '{}' is unknown; give xray, contrast, clutch, "
                      "several joined by +, or none",
                      names, name));
    }
    buttons |= found->second;
  }
  return buttons;
}

int ShowFuses(const Arguments& arguments) {
  const FlashRequest& request = arguments.request;
  if (!arguments.srom.empty() || !arguments.closed_at_rest.empty() || !request.image.empty() ||
      request.force) {
    throw torquer::UsageError(
        "--fuses reads and changes nothing; leave out IMAGE.hex, --srom, --closed-at-rest and "
        "--force");
  }
  const std::atomic<bool>& stop = torquer::StopOnSignal();
  torquer::tools::AvrdudeOptions options;
  options.stop = [&stop] { return stop.load(); };
  const torquer::tools::Fuses fuses =
      torquer::tools::ReadFuses(arguments.programmer, request.port, options);
  fmt::print("lfuse {:#04x}, hfuse {:#04x}, efuse {:#04x}, lock {:#04x}\n", fuses.low, fuses.high,
             fuses.extended, fuses.lock);
  const torquer::tools::FuseVerdict verdict = torquer::tools::JudgeFuses(fuses);
  for (const std::string& line : verdict.lines) fmt::print("{}\n", line);
  return verdict.good ? torquer::kExitSuccess : torquer::kExitFailure;
}

// Throws UsageError if an option that installs no firmware has company that is for installations.
void CheckTogether(const Arguments& arguments) {
  const FlashRequest& request = arguments.request;
  const bool installs = !request.image.empty() || !request.port.empty() || request.force;
  if (!arguments.srom.empty() && (installs || !arguments.closed_at_rest.empty())) {
    throw torquer::UsageError(
        "--srom loads an image into the sensor and installs no firmware; leave out IMAGE.hex, "
        "--port, --force and --closed-at-rest");
  }
  if (!arguments.closed_at_rest.empty() && installs) {
    throw torquer::UsageError(
        "--closed-at-rest changes a setting and installs no firmware; leave out IMAGE.hex, --port "
        "and --force");
  }
}

int Run(Arguments& arguments) {
  if (!arguments.programmer.empty()) return ShowFuses(arguments);
  FlashRequest& request = arguments.request;
  CheckTogether(arguments);
  if (request.image.empty())
    request.image_folder = torquer::FindInstalled("share/torquer/firmware");
  const std::atomic<bool>& stop = torquer::StopOnSignal();

  ProgressBar bar;
  torquer::tools::FlashHooks hooks;
  hooks.say = [](const std::string& text) {
    fmt::print("{}\n", text);
    std::fflush(stdout);
  };
  hooks.progress = [&bar](const std::string& what, int done, int total) {
    bar.Show(what, done, total);
  };
  hooks.stop = [&stop] { return stop.load(); };
  hooks.flash_caterina = [&stop](const std::string& port, const FlashImage& image) {
    torquer::tools::AvrdudeOptions options;
    options.stop = [&stop] { return stop.load(); };
    FlashByCaterina(port, image, options);
  };
  hooks.ask_sketch = torquer::tools::AskSketchIntoCaterina;
  torquer::tools::UsbBoards boards;
  torquer::tools::FlashProcedure procedure(boards, request, hooks);
  if (!arguments.srom.empty()) {
    const int id = procedure.LoadSensorImage(arguments.srom);
    if (id != 0) fmt::print("the sensor runs image {}\n", id);
    return torquer::kExitSuccess;
  }
  if (!arguments.closed_at_rest.empty()) {
    procedure.SetClosedAtRest(ContactsNamed(arguments.closed_at_rest));
    if (!request.dry_run) fmt::print("closed at rest: {}\n", arguments.closed_at_rest);
    return torquer::kExitSuccess;
  }
  const auto outcome = procedure.Run();
  if (outcome) {
    fmt::print(
        "firmware {} runs on {}; self-test: application {}, settings {}, sensor {}{}\n",
        outcome->version.Text(), outcome->serial, GoodOr(outcome->application_good, "damaged"),
        GoodOr(outcome->settings_good, "lost, the defaults are in use"),
        GoodOr(outcome->sensor_good, "does not answer: check its wiring"),
        !outcome->second_sensor_good   ? ""
        : *outcome->second_sensor_good ? ", second sensor good"
                                       : ", second sensor does not answer: check its wiring");
    if (!outcome->supply_warning.empty()) {
      torquer::PrintError("torquer-flash: warning: {}\n", outcome->supply_warning);
    }
  }
  return torquer::kExitSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program("torquer-flash",
                           "Installs firmware on a bench device in any state: writes it, verifies "
                           "it, starts it and reads its self-test.");
  program.Note(
      "Boards with Torquer's firmware or bootloader: to complete an interrupted update, run the "
      "same command again. Boards with Arduino's Caterina: avrdude writes the firmware. Reset the "
      "board first (a Pro Micro twice within a second), then run torquer-flash within 8 s. Boards "
      "with the chip's factory bootloader (DFU): torquer-flash prints instructions.");
  program.Note(
      "Exit status: 0 when the installation is complete; 1 when it was started and not finished "
      "(run it again); 2 when nothing was changed. With --fuses: 1 when the fuses are not safe for "
      "any board.");
  program.Note(
      "The sensor's firmware image (SROM) belongs to its maker and is not part of this project. "
      "The sensor works without it, but tracks better with it on difficult surfaces. The sensor "
      "loses the image without power and in suspend. --srom keeps a copy as SERIAL.srom beside the "
      "device's calibration, and torquer-daemon loads it again after each loss.");
  Arguments arguments;
  FlashRequest& request = arguments.request;
  torquer::Options& options = program.options();
  options.Operand(
      "[IMAGE.hex]", request.image,
      "firmware image to install; without it the image of this build for the board's clock");
  options.Text("--device", "SERIAL", request.device,
               "serial number of the board, required when there are several boards");
  options.Text("--port", "TTY", request.port,
               "serial port of a board in Caterina, of a board with an Arduino program (which is "
               "overwritten), or of the programmer for --fuses",
               torquer::ValueKind::kFile);
  options.Flag("--dry-run", request.dry_run,
               "report the state of the board and the planned steps, and change nothing");
  options.Flag("--force", request.force,
               "allow the installation of an older version over a newer one");
  options.Text(
      "--srom", "FILE", arguments.srom,
      "load the sensor maker's image from this file into the sensor, and install no firmware",
      torquer::ValueKind::kFile);
  options.Text("--closed-at-rest", "CONTACTS", arguments.closed_at_rest,
               "contacts that are closed at rest, such as a sustain pedal: xray, contrast, clutch, "
               "several joined by +, or none; the board keeps this, and no firmware is installed");
  options.Text("--fuses", "PROGRAMMER", arguments.programmer,
               "read and judge the chip's fuses through this ISP programmer (type for avrdude -c), "
               "and change nothing");
  return program.Main(argc, argv, [&] {
    try {
      return Run(arguments);
    } catch (const torquer::tools::FlashUnfinished& unfinished) {
      torquer::PrintError("torquer-flash: {}\n", unfinished.what());
      return static_cast<int>(torquer::kExitFailure);
    }
  });
}
