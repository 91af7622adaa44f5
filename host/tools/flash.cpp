// torquer-flash: puts firmware onto a bench device, whatever state it is in.
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <string>

#include "host/support/command_line.h"
#include "host/support/error.h"
#include "host/tools/caterina.h"
#include "host/tools/flash_procedure.h"
#include "host/tools/usb_boards.h"

namespace {

using torquer::UserError;
using torquer::tools::FlashImage;

constexpr char kUsage[] =
    "usage: torquer-flash [IMAGE.hex] [--device SERIAL] [--dry-run] [--force] [--port TTY]\n"
    "\n"
    "  IMAGE.hex        firmware image (else that of this build for the board's clock)\n"
    "  --device SERIAL  the board with this serial number, if there are several\n"
    "  --dry-run        say what is there and what would be done, and do nothing\n"
    "  --force          install an older version over a newer one\n"
    "  --port TTY       the serial port of a board in Caterina, where it is not found by itself\n"
    "\n"
    "Boards: our firmware and our bootloader (an interruption at any moment is mended by running\n"
    "the same command again); Arduino's Caterina (by avrdude; new boards: reset first, a Pro "
    "Micro\n"
    "twice within a second, then within 8 s run torquer-flash); the chip's DFU is recognized.\n"
    "Exit status: 0 done, 1 begun and not finished (run it again), 2 nothing was changed.\n";
constexpr int kExitUnfinished = 1;

volatile std::sig_atomic_t stop_requested = 0;
void RequestStop(int) { stop_requested = 1; }

// One line that grows, on a terminal alone.
class ProgressBar {
 public:
  void Show(const std::string& what, int done, int total) {
    if (!isatty(STDOUT_FILENO)) return;
    constexpr int kWidth = 40;
    const int filled = kWidth * done / total;
    std::printf("\r%-10s [%s%s] %3d %%%s", what.c_str(),
                std::string(static_cast<std::size_t>(filled), '#').c_str(),
                std::string(static_cast<std::size_t>(kWidth - filled), ' ').c_str(),
                100 * done / total, done == total ? "\n" : "");
    std::fflush(stdout);
    open_ = done != total;
  }
  /// Ends a line that is not full.
  void Break() {
    if (open_) std::printf("\n");
    open_ = false;
  }

 private:
  bool open_ = false;
};

const char* GoodOr(bool good, const char* otherwise) { return good ? "good" : otherwise; }

int Main(int argc, char** argv, ProgressBar& bar) {
  torquer::tools::FlashRequest request;
  bool help = false;
  torquer::CommandLine line;
  line.Operand(request.image);
  line.Option("--device", request.device);
  line.Option("--port", request.port);
  line.Flag("--dry-run", request.dry_run);
  line.Flag("--force", request.force);
  line.Flag("--help", help);
  line.Parse(argc, argv, kUsage);
  if (help) {
    std::printf("%s", kUsage);
    return 0;
  }
  const auto here = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  request.image_folder = (here / "../firmware").lexically_normal();

  struct sigaction action {};
  action.sa_handler = &RequestStop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);

  torquer::tools::FlashHooks hooks;
  hooks.say = [](const std::string& text) {
    std::printf("%s\n", text.c_str());
    std::fflush(stdout);
  };
  hooks.progress = [&bar](const std::string& what, int done, int total) {
    bar.Show(what, done, total);
  };
  hooks.stop = [] { return stop_requested != 0; };
  hooks.flash_caterina = [](const std::string& port, const FlashImage& image) {
    torquer::tools::CaterinaOptions options;
    options.stop = [] { return stop_requested != 0; };
    FlashByCaterina(port, image, options);
  };
  torquer::tools::UsbBoards boards;
  const auto outcome = torquer::tools::FlashProcedure(boards, request, hooks).Run();
  if (outcome) {
    std::printf("firmware %s runs on %s; self-test: application %s, settings %s, sensor %s\n",
                outcome->version.Text().c_str(), outcome->serial.c_str(),
                GoodOr(outcome->application_good, "damaged"),
                GoodOr(outcome->settings_good, "lost, the defaults hold"),
                GoodOr(outcome->sensor_good, "does not answer: check its wiring"));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  ProgressBar bar;
  try {
    return Main(argc, argv, bar);
  } catch (const UserError& error) {
    bar.Break();
    std::fprintf(stderr, "torquer-flash: %s\n", error.what());
    return torquer::kExitUserError;
  } catch (const torquer::tools::FlashUnfinished& unfinished) {
    bar.Break();
    std::fprintf(stderr, "torquer-flash: %s\n", unfinished.what());
    return kExitUnfinished;
  }
}
