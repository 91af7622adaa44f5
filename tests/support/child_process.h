// Child process: a program under test with its exit status and its output.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace torquer::test {

class ChildProcess {
 public:
  /// Starts `words` (the program's path first). The destructor kills it if it still runs.
  explicit ChildProcess(const std::vector<std::string>& words);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  void Signal(int signal) const;

  /// Waits for the end, at most 4 minutes because programs under sanitizers are slow. Returns the
  /// exit status, or 128 + signal if killed. Throws std::runtime_error with its output on timeout.
  int Wait();

  /// True if the program has ended by itself or by a signal.
  bool Ended();

  /// Waits until standard error contains `text`, with the same timeout; false if it never does.
  bool WaitForError(const std::string& text);

  std::string Output() const;  ///< standard output so far
  std::string Error() const;   ///< standard error so far

 private:
  TemporaryFolder folder_;
  pid_t pid_ = -1;
  bool ended_ = false;
  int status_ = 0;
};

}  // namespace torquer::test
