#include "host/tools/avrdude.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <system_error>
#include <thread>

#include "host/support/error.h"

namespace torquer::tools {
namespace {

constexpr int kNotFound = 127;
constexpr auto kStep = std::chrono::milliseconds(10);

}  // namespace

WorkFolder::WorkFolder() {
  std::string path = std::filesystem::temp_directory_path() / "torquer-flash-XXXXXX";
  if (mkdtemp(path.data()) == nullptr) {
    throw UserError(fmt::format("{}: the folder cannot be created; free space there", path));
  }
  path_ = path;
}

WorkFolder::~WorkFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

AvrdudeEnding RunAvrdude(const std::vector<std::string>& arguments, const std::string& log,
                         const std::string& needed_for, const AvrdudeOptions& options) {
  std::vector<std::string> words = arguments;
  words.insert(words.begin(), options.avrdude);
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child < 0) throw std::system_error(errno, std::generic_category(), "fork");
  if (child == 0) {
    setpgid(0, 0);
    const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    const int input = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (output < 0 || input < 0) _exit(126);
    dup2(input, STDIN_FILENO);
    dup2(output, STDOUT_FILENO);
    dup2(output, STDERR_FILENO);
    execvp(argv[0], argv.data());
    _exit(kNotFound);
  }
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(options.timeout_s);
  for (;;) {
    int status = 0;
    if (waitpid(child, &status, WNOHANG) == child) {
      if (!WIFEXITED(status)) return AvrdudeEnding::kFailed;
      if (WEXITSTATUS(status) == kNotFound) {
        throw UserError(fmt::format("{} '{}', which is not installed: sudo apt-get install avrdude",
                                    needed_for, options.avrdude));
      }
      return WEXITSTATUS(status) == 0 ? AvrdudeEnding::kDone : AvrdudeEnding::kFailed;
    }
    const bool stopped = options.stop();
    if (stopped || std::chrono::steady_clock::now() > end) {
      kill(-child, SIGKILL);
      kill(child, SIGKILL);  // the child may not have its own process group yet
      waitpid(child, &status, 0);
      return stopped ? AvrdudeEnding::kStopped : AvrdudeEnding::kTooLong;
    }
    std::this_thread::sleep_for(kStep);
  }
}

std::string FileContents(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace torquer::tools
