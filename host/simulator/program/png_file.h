// X-ray pictures as PNG files.
#pragma once

#include <string>

#include "host/api/torquer/torquer.h"

namespace torquer::program {

/// Writes a gray PNG. Throws UserError naming the path.
void WritePng(const std::string& path, const Picture& picture);

}  // namespace torquer::program
