// Caterina support: boards with Arduino's Caterina bootloader. avrdude writes them through a serial
// port (AVR109).
#pragma once

#include <string>

#include "host/tools/avrdude.h"
#include "host/tools/flash_image.h"

namespace torquer::tools {

/// Manual remedy if nothing else starts the bootloader.
inline constexpr char kResetByHand[] =
    "reset the board (a Pro Micro twice within a second), which starts its bootloader for 8 s, and "
    "run the same command again";

/// Erases, writes all pages except the first, then the first, and verifies all. Caterina starts any
/// application with a programmed first word. An interrupted board therefore stays in Caterina until
/// the first page is written. Only an interruption during the 4 ms of that page leaves an
/// incomplete application that runs. Throws FlashUnfinished with the output of avrdude; UserError
/// if avrdude is not installed.
void FlashByCaterina(const std::string& port, const FlashImage& image,
                     const AvrdudeOptions& options);

/// Makes an Arduino program start Caterina: opens its serial port at 1200 baud and closes it, as
/// Arduino's IDE does. Throws UserError with the remedy if the port cannot be opened.
void AskSketchIntoCaterina(const std::string& port);

}  // namespace torquer::tools
