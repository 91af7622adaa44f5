// The terminal of a guided calibration: single keys in, lasting lines and one changing line out.
#pragma once

#include <termios.h>

#include <cstddef>
#include <optional>
#include <string>

namespace torquer::tools {

class Terminal {
 public:
  /// Where standard input is a terminal, keys are read as they are pressed, without echo, until the
  /// destructor restores it.
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// The key that was pressed, if any; Enter is '\n'.
  std::optional<char> Key();

  /// A lasting line, above the changing one.
  void Print(const std::string& line);
  /// Replaces the changing line; does nothing where standard output is not a terminal.
  void Change(const std::string& line);

  /// Columns of the terminal; 80 where there is none.
  int columns() const { return columns_; }

 private:
  bool keys_ = false;
  bool ended_ = false;
  bool screen_ = false;
  int columns_ = 80;
  termios before_{};
  std::string changing_;
};

/// Asks on standard output and reads a line of standard input; "" at the end of the input as well.
std::string Ask(const std::string& question);

/// Whether a person can be asked: standard input and output are both a terminal.
bool CanAsk();

}  // namespace torquer::tools
