// Runs another program beside this one.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

namespace torquer {

/// A program in the background: without a terminal's input or Ctrl-C, with its output in a file. It
/// gets SIGTERM when this process ends for any reason. Use it from one thread, which must live as
/// long.
class ChildProgram {
 public:
  /// Starts `words`, the program's path first. The output replaces the file `output`. Throws
  /// UserError naming the program or the file, and the reason.
  ChildProgram(const std::vector<std::string>& words, const std::string& output);
  /// Kills the program if it still runs.
  ~ChildProgram();
  ChildProgram(const ChildProgram&) = delete;
  ChildProgram& operator=(const ChildProgram&) = delete;

  /// Exit status, or 128 + signal; empty while the program runs. Does not wait.
  std::optional<int> Ended();

  /// Sends SIGTERM or SIGKILL to the program, unless it has ended.
  void Signal(int signal) const;

  /// Last part of the output, up to `most_bytes`; "" if it cannot be read.
  std::string LastOutput(std::size_t most_bytes) const;

 private:
  std::string output_;
  pid_t process_ = -1;
  std::optional<int> ended_;
};

}  // namespace torquer
