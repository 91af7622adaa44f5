#include "host/support/child_program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>

#include "host/support/error.h"

namespace torquer {
namespace {

struct Spawning {
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_t actions;
  Spawning() {
    posix_spawnattr_init(&attributes);
    posix_spawn_file_actions_init(&actions);
  }
  ~Spawning() {
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
  }
  Spawning(const Spawning&) = delete;
  Spawning& operator=(const Spawning&) = delete;
};

}  // namespace

ChildProgram::ChildProgram(const std::vector<std::string>& words, const std::string& output)
    : output_(output) {
  if (access(words.front().c_str(), X_OK) != 0) {
    throw UserError(fmt::format("{}: cannot be started: {}; build or install it", words.front(),
                                std::strerror(errno)));
  }
  const int file =
      open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (file < 0) {
    throw UserError(fmt::format("{}: cannot be written: {}; name another folder", output,
                                std::strerror(errno)));
  }
  Spawning spawning;
  posix_spawn_file_actions_addopen(&spawning.actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&spawning.actions, file, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&spawning.actions, file, STDERR_FILENO);
  posix_spawn_file_actions_addclosefrom_np(&spawning.actions, STDERR_FILENO + 1);
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setpgroup(&spawning.attributes, 0);  // keeps Ctrl-C away from the child
  posix_spawnattr_setsigmask(&spawning.attributes, &none);
  posix_spawnattr_setsigdefault(&spawning.attributes, &all);
  posix_spawnattr_setflags(&spawning.attributes,
                           POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  // setpriv (util-linux) requests the signal from the kernel and then becomes the program.
  std::vector<std::string> all_words = {"setpriv", "--pdeathsig", "TERM", "--"};
  all_words.insert(all_words.end(), words.begin(), words.end());
  std::vector<char*> argv;
  for (std::string& word : all_words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const int error = posix_spawnp(&process_, argv[0], &spawning.actions, &spawning.attributes,
                                 argv.data(), environ);
  close(file);
  if (error == 0) return;
  throw UserError(fmt::format("{}: cannot be started: {}; setpriv, of util-linux, does that",
                              words.front(), std::strerror(error)));
}

ChildProgram::~ChildProgram() {
  if (Ended()) return;
  kill(process_, SIGKILL);
  while (waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

std::optional<int> ChildProgram::Ended() {
  if (ended_) return ended_;
  int status = 0;
  if (waitpid(process_, &status, WNOHANG) != process_) return std::nullopt;
  ended_ = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  return ended_;
}

void ChildProgram::Signal(int signal) const {
  if (!ended_) kill(process_, signal);
}

std::string ChildProgram::LastOutput(std::size_t most_bytes) const {
  std::ifstream file(output_, std::ios::binary | std::ios::ate);
  const std::streamoff size = file.tellg();
  if (size <= 0) return "";
  const std::streamoff length = std::min(size, static_cast<std::streamoff>(most_bytes));
  std::string text(static_cast<std::size_t>(length), '\0');
  file.seekg(size - length);
  file.read(text.data(), length);
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

}  // namespace torquer
