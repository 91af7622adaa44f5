// The secret in the page's URL.
#pragma once

#include <string>

namespace torquer::viewer {

/// 32 hexadecimal digits of the kernel's randomness.
std::string RandomToken();

/// The token in `path`, so that open pages find a viewer that was started again; where there is no
/// such file it is made, readable by its owner alone. Throws UserError where it can neither be read
/// nor made, where others may read it, or where it holds no token.
std::string KeptToken(const std::string& path);

}  // namespace torquer::viewer
