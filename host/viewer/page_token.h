// The secret in the page's URL.
#pragma once

#include <string>

namespace torquer::viewer {

/// 32 random hexadecimal digits from the kernel.
std::string RandomToken();

/// Token in the file `path`, so that open pages find a restarted viewer. A missing file is created,
/// readable by its owner alone. Throws UserError for a file that can neither be read nor created,
/// that others may read, or without a token.
std::string KeptToken(const std::string& path);

}  // namespace torquer::viewer
