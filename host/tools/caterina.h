// Boards that keep Arduino's Caterina bootloader, which speaks AVR109 on a serial port: served by
// avrdude.
#pragma once

#include <functional>
#include <string>

#include "host/tools/flash_image.h"

namespace torquer::tools {

struct CaterinaOptions {
  std::string avrdude = "avrdude";  ///< program
  int timeout_s = 60;  ///< after which it is killed: it waits for ever for a lost board
  /// Whether the user wants to stop.
  std::function<bool()> stop = [] { return false; };
};

/// Erases, writes all pages but the first, then the first, and verifies all. Caterina starts
/// whatever has a first word, so that a board that is cut off stays in it until the very end; a cut
/// during the first page's 4 ms is the one that leaves half an application running. Throws
/// FlashUnfinished with what avrdude said; UserError if it is not installed.
void FlashByCaterina(const std::string& port, const FlashImage& image,
                     const CaterinaOptions& options);

}  // namespace torquer::tools
