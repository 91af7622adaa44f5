// The chip's fuses: read by avrdude through an ISP programmer, and judged.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host/tools/avrdude.h"

namespace torquer::tools {

/// As avrdude prints them; a bit that is 0 is programmed.
struct Fuses {
  std::uint8_t low = 0xff, high = 0xff, extended = 0xff, lock = 0xff;
};

/// Reads them from the chip at the ISP programmer `programmer` (avrdude -c) and, where it needs
/// one, its serial port `port`. Throws UserError with the output of avrdude and the remedy.
Fuses ReadFuses(const std::string& programmer, const std::string& port,
                const AvrdudeOptions& options);

struct FuseVerdict {
  /// False if with these fuses neither a board of 8 MHz nor one of 16 MHz is safe.
  bool good = true;
  /// A line for each thing that the fuses decide.
  std::vector<std::string> lines;
};

/// By the data sheet of the ATmega32U4, against what firmware/bootloader/README.md writes.
FuseVerdict JudgeFuses(const Fuses& fuses);

}  // namespace torquer::tools
