#include "host/tools/fuses.h"

#include <fmt/format.h>

#include <cctype>
#include <cstdlib>
#include <optional>

#include "host/support/error.h"

namespace torquer::tools {
namespace {

// Typical level in volts of each BODLEVEL; 0: no brown-out detection.
constexpr double kBrownOut_v[] = {4.3, 3.5, 3.4, 2.6, 2.4, 2.2, 2.0, 0};
// Levels required by firmware/bootloader/README.md, which gives the reasons.
constexpr double kFor16Mhz_v = 4.3, kFor8Mhz_v = 2.6;

std::string BrownOut(double level_v, bool& good) {
  if (level_v == 0) {
    good = false;
    return "brown-out detection is off: a failing supply lets the CPU do anything. Write efuse "
           "0xcb where the CPU runs at 8 MHz, 0xc8 where it runs at 16 MHz";
  }
  const std::string level = fmt::format("brown-out at {:.1f} V: ", level_v);
  if (level_v == kFor16Mhz_v) {
    return level + "right for 16 MHz at 5 V; a board at 3.3 V does not start with it";
  }
  if (level_v == kFor8Mhz_v) {
    return level + "right for 8 MHz; too low for 16 MHz, which needs 4.5 V: write efuse 0xc8 there";
  }
  if (level_v > kFor8Mhz_v) {
    return level +
           "too low for 16 MHz, and above a supply of 3.3 V: write efuse 0xc8 at 16 MHz, 0xcb "
           "at 8 MHz";
  }
  good = false;
  return level + "too low for 8 MHz, which needs 2.7 V: write efuse 0xcb";
}

std::optional<std::uint8_t> ReadHex(const std::string& path) {
  const std::string text = FileContents(path);
  char* end = nullptr;
  const unsigned long value = std::strtoul(text.c_str(), &end, 16);
  while (std::isspace(static_cast<unsigned char>(*end))) ++end;
  if (text.empty() || *end != '\0' || value > 0xff) return std::nullopt;
  return static_cast<std::uint8_t>(value);
}

}  // namespace

Fuses ReadFuses(const std::string& programmer, const std::string& port,
                const AvrdudeOptions& options) {
  const WorkFolder folder;
  const std::string log = folder.Path("log");
  std::vector<std::string> arguments = {"-p", "m32u4", "-c", programmer, "-B", "10"};
  if (!port.empty()) arguments.insert(arguments.end(), {"-P", port});
  for (const char* name : {"lfuse", "hfuse", "efuse", "lock"}) {
    arguments.insert(arguments.end(), {"-U", fmt::format("{}:r:{}:h", name, folder.Path(name))});
  }
  const AvrdudeEnding ending = RunAvrdude(arguments, log, "fuses are read by", options);
  const auto low = ReadHex(folder.Path("lfuse")), high = ReadHex(folder.Path("hfuse")),
             extended = ReadHex(folder.Path("efuse")), lock = ReadHex(folder.Path("lock"));
  if (ending == AvrdudeEnding::kStopped) throw UserError("stopped. Nothing was changed.");
  if (ending != AvrdudeEnding::kDone || !low || !high || !extended || !lock) {
    throw UserError(fmt::format(
        "the fuses cannot be read through the programmer '{}'; check its six wires, unplug the "
        "sensor, give the board power, and name the programmer as avrdude -c '?' lists it. avrdude "
        "said:\n{}",
        programmer, FileContents(log)));
  }
  return {*low, *high, *extended, *lock};
}

FuseVerdict JudgeFuses(const Fuses& fuses) {
  FuseVerdict verdict;
  const auto say = [&](bool good, const std::string& yes, const std::string& no) {
    verdict.lines.push_back(good ? yes : no);
    verdict.good = verdict.good && good;
  };
  // CKSEL3..1 = 111 selects a crystal of 8 to 16 MHz.
  say((fuses.low & 0x0e) == 0x0e, "clock: the crystal",
      "clock: not the crystal, so that the USB does not work; write lfuse 0xff");
  if ((fuses.low & 0x80) == 0) {
    verdict.lines.emplace_back("clock: divided by 8 at the start, which the firmware undoes");
  }
  say((fuses.high & 0x20) == 0, "ISP: enabled", "ISP: disabled; write hfuse 0xd2");
  if ((fuses.high & 0x40) == 0) {
    verdict.lines.emplace_back("JTAG: enabled on the joystick's pins, which the firmware undoes");
  }
  say((fuses.high & 0x10) != 0, "watchdog: started by the firmware",
      "watchdog: always on, which a bootloader may not expect; write hfuse 0xd2");
  const int size_bytes = 4096 >> ((fuses.high >> 1) & 3);
  if ((fuses.high & 0x01) == 0) {
    verdict.lines.push_back(fmt::format("reset: into a bootloader of {} bytes, as {}", size_bytes,
                                        size_bytes == 4096   ? "Arduino's is"
                                        : size_bytes == 2048 ? "ours is"
                                                             : "neither ours nor Arduino's is"));
    verdict.good = verdict.good && size_bytes >= 2048;
  } else {
    say(false, "", "reset: past the bootloader, if there is one; write hfuse 0xd2");
  }
  verdict.lines.emplace_back((fuses.high & 0x08) == 0
                                 ? "EEPROM: kept when the chip is erased"
                                 : "EEPROM: serial number and settings are lost when the chip is "
                                   "erased by a programmer");
  verdict.lines.push_back(BrownOut(kBrownOut_v[fuses.extended & 7], verdict.good));
  verdict.lines.emplace_back(
      (fuses.lock & 0x10) == 0 ? "bootloader: protected from the application"
                               : "bootloader: the application could overwrite it; write lock 0xef");
  return verdict;
}

}  // namespace torquer::tools
