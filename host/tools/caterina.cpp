#include "host/tools/caterina.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "host/support/error.h"
#include "host/tools/flash_procedure.h"

namespace torquer::tools {

void FlashByCaterina(const std::string& port, const FlashImage& image,
                     const AvrdudeOptions& options) {
  const WorkFolder folder;
  const std::string all = folder.Path("all.hex");
  const std::string first = folder.Path("first_page.hex");
  const std::string rest = folder.Path("all_but_first_page.hex");
  const std::string log = folder.Path("log");
  const int pages = image.pages();
  WriteHexFile(first, image, 0, 1);
  WriteHexFile(rest, image, 1, pages + 1);
  WriteHexFile(all, image, 0, pages + 1);
  const AvrdudeEnding ending = RunAvrdude(
      {"-p", "m32u4", "-c", "avr109", "-b", "57600", "-P", port, "-e", "-D", "-V", "-U",
       "flash:w:" + rest + ":i", "-U", "flash:w:" + first + ":i", "-U", "flash:v:" + all + ":i"},
      log, "a board with Caterina is written by", options);
  const std::string reason = [&]() -> std::string {
    switch (ending) {
      case AvrdudeEnding::kDone:
        break;
      case AvrdudeEnding::kFailed:
        return fmt::format("avrdude failed with this output:\n{}\n", FileContents(log));
      case AvrdudeEnding::kTooLong:
        return fmt::format("avrdude did not end within {} s and was killed: the board was lost. ",
                           options.timeout_s);
      case AvrdudeEnding::kStopped:
        return "stopped. ";
    }
    return {};
  }();
  if (reason.empty()) return;
  throw FlashUnfinished(
      reason +
      "Unless nothing was written yet, the board has no complete application. Plug it in: it stays "
      "in Caterina, or if it does not, reset it (a Pro Micro twice within a second), and run the "
      "same "
      "command again within 8 s. Our own bootloader does not need this "
      "(firmware/bootloader/README.md).");
}

void AskSketchIntoCaterina(const std::string& port) {
  const int tty = open(port.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (tty < 0) {
    throw UserError(fmt::format("{}: the serial port cannot be opened: {}; {}", port,
                                std::strerror(errno), kResetByHand));
  }
  termios settings{};
  const bool is_port = tcgetattr(tty, &settings) == 0;
  if (is_port) {
    // Arduino's core starts the bootloader when the port is closed at this speed.
    cfsetspeed(&settings, B1200);
    settings.c_cflag |= HUPCL;
    tcsetattr(tty, TCSANOW, &settings);
    const int terminal_ready = TIOCM_DTR;
    ioctl(tty, TIOCMBIC, &terminal_ready);
  }
  close(tty);
  if (!is_port) throw UserError(fmt::format("{}: is not a serial port; {}", port, kResetByHand));
}

}  // namespace torquer::tools
