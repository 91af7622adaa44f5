// torquer-flash: installs firmware on a bench device, whatever state it is in.
#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <string>

#include "host/support/program.h"
#include "host/support/stop_signal.h"
#include "host/tools/caterina.h"
#include "host/tools/flash_procedure.h"
#include "host/tools/usb_boards.h"

namespace {

using torquer::tools::FlashImage;
using torquer::tools::FlashRequest;

// One line that grows; nothing where standard output is no terminal.
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
  // Ends a line that is not full.
  void Break() {
    if (open_) fmt::print("\n");
    std::fflush(stdout);
    open_ = false;
  }

  bool open_ = false;
};

const char* GoodOr(bool good, const char* otherwise) { return good ? "good" : otherwise; }

int Run(FlashRequest& request) {
  const auto here = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  request.image_folder = (here / "../firmware").lexically_normal();
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
    torquer::tools::CaterinaOptions options;
    options.stop = [&stop] { return stop.load(); };
    FlashByCaterina(port, image, options);
  };
  torquer::tools::UsbBoards boards;
  const auto outcome = torquer::tools::FlashProcedure(boards, request, hooks).Run();
  if (outcome) {
    fmt::print("firmware {} runs on {}; self-test: application {}, settings {}, sensor {}\n",
               outcome->version.Text(), outcome->serial,
               GoodOr(outcome->application_good, "damaged"),
               GoodOr(outcome->settings_good, "lost, the defaults are in use"),
               GoodOr(outcome->sensor_good, "does not answer: check its wiring"));
  }
  return torquer::kExitSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program("torquer-flash",
                           "Installs firmware on a bench device, whatever state it is in: writes, "
                           "verifies, starts it, and reads its self-test.");
  program.Note(
      "Boards: with our firmware or bootloader, an update that was interrupted at any moment is "
      "completed by running the same command again. A board with Arduino's Caterina is written by "
      "avrdude: reset it first (a Pro Micro twice within a second), then run torquer-flash within "
      "8 "
      "s. The factory bootloader of the chip (DFU) is recognized, with instructions.");
  program.Note(
      "Exit status: 0 when it is done, 1 when it was begun and not finished (run it again), 2 when "
      "nothing was changed.");
  FlashRequest request;
  torquer::Options& options = program.options();
  options.Operand("[IMAGE.hex]", request.image,
                  "firmware image; without it the one of this build for the board's clock");
  options.Text("--device", "SERIAL", request.device,
               "board with this serial number, needed when there are several");
  options.Text("--port", "TTY", request.port,
               "serial port of a board in Caterina, needed where it is not found",
               torquer::ValueKind::kFile);
  options.Flag("--dry-run", request.dry_run,
               "report what is there and what would be done, and change nothing");
  options.Flag("--force", request.force, "install an older version over a newer one");
  return program.Main(argc, argv, [&] {
    try {
      return Run(request);
    } catch (const torquer::tools::FlashUnfinished& unfinished) {
      fmt::print(stderr, "torquer-flash: {}\n", unfinished.what());
      return static_cast<int>(torquer::kExitFailure);
    }
  });
}
