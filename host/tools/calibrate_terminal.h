// Terminal of a guided calibration: single-key input, permanent lines and one status line as
// output.
#pragma once

#include <termios.h>

#include <cstddef>
#include <optional>
#include <string>

namespace torquer::tools {

class Terminal {
 public:
  /// If standard input is a terminal, keys are read one by one without echo until the destructor
  /// restores it.
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// Returns the next pressed key, if any; Enter is '\n'.
  std::optional<char> Key();

  /// Prints a permanent line above the status line.
  void Print(const std::string& line);
  /// Replaces the status line, if standard output is a terminal.
  void Change(const std::string& line);

  /// Columns of the terminal; 80 if there is no terminal.
  int columns() const { return columns_; }

 private:
  bool keys_ = false;
  bool ended_ = false;
  bool screen_ = false;
  int columns_ = 80;
  termios before_{};
  std::string changing_;
};

/// Asks on standard output and reads a line of standard input; also "" at the end of the input.
std::string Ask(const std::string& question);

/// True if the user can be asked: standard input and output are both a terminal.
bool CanAsk();

}  // namespace torquer::tools
