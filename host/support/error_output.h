// Messages on standard error: the one place where programs write them.
#pragma once

#include <fmt/format.h>

#include <exception>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace torquer {

/// Opens /dev/null for each of the first three descriptors that is closed, so that no file of the
/// program gets its number and, with it, the messages. What is written to it is still refused.
void OccupyStandardStreams() noexcept;

/// Writes `text` to standard error. Line ends stay; other control characters become escapes, as
/// Printable() has them. A stream that is full, closed or without a reader loses the message, and
/// neither throws nor ends the program.
void WriteError(std::string_view text) noexcept;

/// The same for a line that shows progress on a terminal: `text` is the program's own, unescaped.
void WriteProgress(std::string_view text) noexcept;

/// Formats a message and writes it as WriteError() does.
template <class... Arguments>
void PrintError(fmt::format_string<Arguments...> format, Arguments&&... arguments) noexcept {
  try {
    WriteError(fmt::format(format, std::forward<Arguments>(arguments)...));
  } catch (const std::exception&) {
    WriteError("a message cannot be shown for lack of memory\n");
  }
}

/// The remedy for an error of the system that a limit or the machine's state causes, such as "raise
/// the limit of open files (ulimit -n)"; "" for every other.
std::string RemedyOf(const std::error_code& error);

}  // namespace torquer
