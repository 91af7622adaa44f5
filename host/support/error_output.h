// Writes messages to standard error, for all programs.
#pragma once

#include <fmt/format.h>

#include <exception>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace torquer {

/// Opens /dev/null for each closed descriptor among the first three. Otherwise a file of the
/// program would get its number and the messages. A write to it still fails.
void OccupyStandardStreams() noexcept;

/// Writes `text` to standard error. Line ends stay; Printable() escapes other control characters. A
/// full or closed stream, or one without a reader, loses the message. The call neither throws nor
/// ends the program.
void WriteError(std::string_view text) noexcept;

/// Same for a line of progress on a terminal: `text` comes from the program and is not escaped.
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

/// Remedy for a system error that a limit or the machine's state causes, or "". Example: "raise the
/// limit of open files (ulimit -n)".
std::string RemedyOf(const std::error_code& error);

}  // namespace torquer
