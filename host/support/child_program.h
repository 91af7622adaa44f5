// A program that runs beside this one, and ends with it.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

namespace torquer {

/// A program in the background: without a terminal's input or Ctrl-C, with its output in a file. It
/// is sent SIGTERM when this process ends, however that comes. Use it from one thread, which lives
/// as long.
class ChildProgram {
 public:
  /// Starts `words`, the program's path first. What it prints goes to the file `output`, which is
  /// replaced. Throws UserError naming the program or the file, and the reason.
  ChildProgram(const std::vector<std::string>& words, const std::string& output);
  /// Kills it if it still runs.
  ~ChildProgram();
  ChildProgram(const ChildProgram&) = delete;
  ChildProgram& operator=(const ChildProgram&) = delete;

  /// Nothing while it runs; afterwards its exit status, or 128 + signal. Does not wait.
  std::optional<int> Ended();

  /// Asks it to end (SIGTERM), or kills it (SIGKILL); nothing where it has ended.
  void Signal(int signal) const;

  /// Up to `most_bytes` of the end of what it has printed; "" where that cannot be read.
  std::string LastOutput(std::size_t most_bytes) const;

 private:
  std::string output_;
  pid_t process_ = -1;
  std::optional<int> ended_;
};

}  // namespace torquer
