// Standard input and output for a dialog with another program.
#pragma once

#include <atomic>
#include <optional>
#include <string>
#include <string_view>

namespace torquer {

/// Stands for standard input or output in place of a file on a command line.
inline constexpr char kStandardStream[] = "-";

/// Reads lines and writes answers in turn. It never waits for more input than one line, and does
/// not delay output.
class StandardStreams {
 public:
  /// `stop` ends waiting and must outlive this. `answers`: true if Write is used. Then a missing
  /// reader does not end the program by SIGPIPE.
  StandardStreams(const std::atomic<bool>& stop, bool answers);

  /// Waits for a line and returns it without its end. Returns none after the last line, once `stop`
  /// is set, or when the reader of the answers has gone. Throws UserError if the input cannot be
  /// read, or a line has more than a million bytes.
  std::optional<std::string> NextLine();

  /// Writes `text` at once. Returns false if the reader has gone, or does not read until `stop` is
  /// set. Throws UserError for other failures.
  bool Write(std::string_view text);

  bool reader_gone() const { return reader_gone_; }
  /// True if NextLine returns nullopt before the end of the input.
  bool interrupted() const { return reader_gone_ || stop_; }

 private:
  bool WaitForInput();

  const std::atomic<bool>& stop_;
  const bool answers_;
  std::string received_;  // received, but not yet returned
  bool ended_ = false;
  bool reader_gone_ = false;
};

}  // namespace torquer
