#include "tests/support/child_process.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

#include "tests/support/file_contents.h"

namespace torquer::test {
namespace {

constexpr int kPatienceMs = 240000;
constexpr int kStepMs = 5;

void Pause() { std::this_thread::sleep_for(std::chrono::milliseconds(kStepMs)); }

}  // namespace

ChildProcess::ChildProcess(const std::vector<std::string>& words) {
  const std::string output = folder_.Path("out");
  const std::string error = folder_.Path("err");
  std::vector<std::string> copy = words;
  std::vector<char*> arguments;
  for (std::string& word : copy) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error("cannot fork");
  if (pid_ == 0) {
    dup2(open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDOUT_FILENO);
    dup2(open(error.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDERR_FILENO);
    // An inherited descriptor of a device's other end would prevent its hang-up.
    close_range(3, ~0U, 0);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
}

ChildProcess::~ChildProcess() {
  if (Ended()) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, &status_, 0);
}

void ChildProcess::Signal(int signal) const { kill(pid_, signal); }

bool ChildProcess::Ended() {
  if (!ended_ && waitpid(pid_, &status_, WNOHANG) == pid_) ended_ = true;
  return ended_;
}

int ChildProcess::Wait() {
  for (int waited = 0; !Ended() && waited < kPatienceMs; waited += kStepMs) Pause();
  if (!ended_) throw std::runtime_error("the program does not end; it wrote: " + Error());
  return WIFSIGNALED(status_) ? 128 + WTERMSIG(status_) : WEXITSTATUS(status_);
}

bool ChildProcess::WaitForError(const std::string& text) {
  for (int waited = 0; waited < kPatienceMs; waited += kStepMs) {
    const bool ended = Ended();  // first, so that its last output is included
    if (Error().find(text) != std::string::npos) return true;
    if (ended) return false;
    Pause();
  }
  return false;
}

std::string ChildProcess::Output() const { return Contents(folder_.Path("out")); }
std::string ChildProcess::Error() const { return Contents(folder_.Path("err")); }

}  // namespace torquer::test
