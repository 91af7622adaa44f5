// Standard input and output as the two ends of a conversation with another program.
#pragma once

#include <atomic>
#include <optional>
#include <string>
#include <string_view>

namespace torquer {

/// On a command line in the place of a file: standard input or output.
inline constexpr char kStandardStream[] = "-";

/// A line that came and its answer, in turn. Nothing is read ahead of what the other side sent, and
/// nothing is kept back.
class StandardStreams {
 public:
  /// Waiting ends with `stop`, which must outlive this. `answers`: whether Write is used. Then a
  /// reader that goes away ends no program by SIGPIPE.
  StandardStreams(const std::atomic<bool>& stop, bool answers);

  /// Waits for a line; without its end. None at the end of the input, once `stop` is set, and when
  /// the reader of the answers has gone. Throws UserError where the input cannot be read, or a line
  /// has more than a million bytes.
  std::optional<std::string> NextLine();

  /// Hands `text` over at once. False when its reader has gone, or does not read until `stop` is
  /// set; UserError when it cannot be written otherwise.
  bool Write(std::string_view text);

  bool reader_gone() const { return reader_gone_; }
  /// True if NextLine returns nullopt before the end of the input.
  bool interrupted() const { return reader_gone_ || stop_; }

 private:
  bool WaitForInput();

  const std::atomic<bool>& stop_;
  const bool answers_;
  std::string received_;  // not yet given out
  bool ended_ = false;
  bool reader_gone_ = false;
};

}  // namespace torquer
