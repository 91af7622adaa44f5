// A program under test, run beside the test: its exit status and what it wrote.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace torquer::test {

class ChildProcess {
 public:
  /// Starts `words` (the program's path first). It is killed at destruction if it still runs.
  explicit ChildProcess(const std::vector<std::string>& words);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  void Signal(int signal) const;

  /// Waits for the end, for 4 minutes at most: programs under sanitizers are slow. The exit status;
  /// 128 + signal when killed by one; throws std::runtime_error with what it wrote when it does not
  /// end.
  int Wait();

  /// Waits until standard error holds `text`, as long as that; false if it never does.
  bool WaitForError(const std::string& text);

  std::string Output() const;  ///< standard output so far
  std::string Error() const;   ///< standard error so far

 private:
  bool Ended();

  TemporaryFolder folder_;
  pid_t pid_ = -1;
  bool ended_ = false;
  int status_ = 0;
};

}  // namespace torquer::test
