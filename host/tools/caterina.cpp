#include "host/tools/caterina.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>
#include <thread>
#include <vector>

#include "host/support/error.h"
#include "host/tools/flash_procedure.h"

namespace torquer::tools {
namespace {

constexpr int kNotFound = 127;
constexpr auto kStep = std::chrono::milliseconds(10);

class WorkFolder {
 public:
  WorkFolder() {
    std::string path = std::filesystem::temp_directory_path() / "torquer-flash-XXXXXX";
    if (!mkdtemp(path.data())) throw UserError(path + ": cannot be made; is the disk full?");
    path_ = path;
  }
  ~WorkFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;

  std::string Path(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

enum class Ending { kDone, kFailed, kNotInstalled, kTooLong, kStopped };

// Runs a program with its output in a file; it and its children do not outlive `options`' time.
Ending RunWithin(std::vector<std::string> words, const std::string& log,
                 const CaterinaOptions& options) {
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const pid_t child = fork();
  if (child < 0) throw std::system_error(errno, std::generic_category(), "fork");
  if (child == 0) {
    setpgid(0, 0);
    const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    const int input = open("/dev/null", O_RDONLY | O_CLOEXEC);
    dup2(input, STDIN_FILENO);
    dup2(output, STDOUT_FILENO);
    dup2(output, STDERR_FILENO);
    execvp(arguments[0], arguments.data());
    _exit(kNotFound);
  }
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(options.timeout_s);
  for (;;) {
    int status = 0;
    if (waitpid(child, &status, WNOHANG) == child) {
      if (!WIFEXITED(status)) return Ending::kFailed;
      if (WEXITSTATUS(status) == kNotFound) return Ending::kNotInstalled;
      return WEXITSTATUS(status) == 0 ? Ending::kDone : Ending::kFailed;
    }
    const bool stopped = options.stop();
    if (stopped || std::chrono::steady_clock::now() > end) {
      kill(-child, SIGKILL);
      kill(child, SIGKILL);  // should it not have its own group yet
      waitpid(child, &status, 0);
      return stopped ? Ending::kStopped : Ending::kTooLong;
    }
    std::this_thread::sleep_for(kStep);
  }
}

std::string Contents(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace

void FlashByCaterina(const std::string& port, const FlashImage& image,
                     const CaterinaOptions& options) {
  const WorkFolder folder;
  const std::string all = folder.Path("all.hex");
  const std::string first = folder.Path("first_page.hex");
  const std::string rest = folder.Path("all_but_first_page.hex");
  const std::string log = folder.Path("log");
  const int pages = image.pages();
  WriteHexFile(first, image, 0, 1);
  WriteHexFile(rest, image, 1, pages + 1);
  WriteHexFile(all, image, 0, pages + 1);
  const Ending ending = RunWithin({options.avrdude, "-p", "m32u4", "-c", "avr109", "-b", "57600",
                                   "-P", port, "-e", "-D", "-V", "-U", "flash:w:" + rest + ":i",
                                   "-U", "flash:w:" + first + ":i", "-U", "flash:v:" + all + ":i"},
                                  log, options);
  const std::string reason = [&]() -> std::string {
    switch (ending) {
      case Ending::kDone:
        return {};
      case Ending::kNotInstalled:
        throw UserError("a board with Caterina is written by '" + options.avrdude +
                        "', which is not installed: sudo apt-get install avrdude");
      case Ending::kFailed:
        return "avrdude failed. It said:\n" + Contents(log) + "\n";
      case Ending::kTooLong:
        return "avrdude did not end within " + std::to_string(options.timeout_s) +
               " s and was killed: the board was lost. ";
      case Ending::kStopped:
        return "stopped. ";
    }
    return {};
  }();
  if (reason.empty()) return;
  throw FlashUnfinished(
      reason +
      "Unless nothing was written yet, the board has no whole application. Plug it in: it stays in "
      "Caterina, or if it does not, reset it (a Pro Micro twice within a second), and run the same "
      "command again within 8 s. Our own bootloader needs no such care "
      "(firmware/bootloader/README.md).");
}

}  // namespace torquer::tools
