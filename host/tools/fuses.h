// Fuses of the chip: read by avrdude through an ISP programmer, and checked.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host/tools/avrdude.h"

namespace torquer::tools {

/// Fuse bytes as printed by avrdude; a 0 bit is programmed.
struct Fuses {
  std::uint8_t low = 0xff, high = 0xff, extended = 0xff, lock = 0xff;
};

/// Reads the fuses through the ISP programmer `programmer` (avrdude -c) and, if it needs one, its
/// serial port `port`. Throws UserError with the output of avrdude and the remedy.
Fuses ReadFuses(const std::string& programmer, const std::string& port,
                const AvrdudeOptions& options);

struct FuseVerdict {
  /// False if these fuses are unsafe for boards of 8 MHz and of 16 MHz alike.
  bool good = true;
  /// One line for each function that the fuses control.
  std::vector<std::string> lines;
};

/// Checks the fuses by the data sheet of the ATmega32U4 against the values in
/// firmware/bootloader/README.md.
FuseVerdict JudgeFuses(const Fuses& fuses);

}  // namespace torquer::tools
