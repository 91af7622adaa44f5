// The terminal of a guided session: single keys in, lasting lines and one changing line out.
#pragma once

#include <termios.h>

#include <cstddef>
#include <optional>
#include <string>

namespace torquer::tools {

class Terminal {
 public:
  /// Keys come as they are pressed, without echo, where standard input is a terminal; it is as
  /// before when this object is gone.
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// A key, if one was pressed; Enter is '\n'.
  std::optional<char> Key();

  /// A lasting line, above the changing one.
  void Print(const std::string& line);
  /// Replaces the changing line; does nothing where standard output is no terminal.
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

/// Asks on standard output and reads a line of standard input; "" at the end of the input, too.
std::string Ask(const std::string& question);

/// Standard input and output are both a terminal: somebody can be asked.
bool CanAsk();

}  // namespace torquer::tools
