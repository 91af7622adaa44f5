// Text of any origin, made harmless for a terminal.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace torquer {

/// `text` with everything that is no visible character or space written out as an escape: control
/// characters and bytes that are not UTF-8 as \x1b, characters that hide or turn text around as
/// \u{202e}. What is printed can then neither move the cursor nor pretend to be another line. Of a
/// text longer than `most_bytes` the beginning and "..". For all that came in a message, a log or a
/// file, and is printed; text that the program wrote itself stays as it is.
std::string Printable(std::string_view text, std::size_t most_bytes = 500);

}  // namespace torquer
