// Makes text of any origin safe for a terminal.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace torquer {

/// Copy of `text` with escapes in place of all invisible characters except spaces. Control
/// characters and bytes that are not UTF-8 become \x1b; characters that hide or reverse text become
/// \u{202e}. The output can neither move the cursor nor imitate another line. A text longer than
/// `most_bytes` is cut and ends with "..". Use it for printed text from messages, logs and files,
/// not for the program's own text.
std::string Printable(std::string_view text, std::size_t most_bytes = 500);

}  // namespace torquer
