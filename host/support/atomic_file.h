// Files that are replaced in one step.
#pragma once

#include <string>

namespace torquer {

/// Replaces the file at `path` by `text`: whatever goes wrong, a power cut included, it holds
/// either what it held or all of the text. Throws UserError naming the file and the reason.
void WriteFileAtomically(const std::string& path, const std::string& text);

}  // namespace torquer
