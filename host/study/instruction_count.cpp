#include "host/study/instruction_count.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>

namespace torquer::study {
namespace {

// Runs a command with standard output and error written to `log`. Returns the exit status; 127 if
// it cannot be started.
int Run(std::vector<std::string> words, const std::string& log) {
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t child = -1;
  const int error =
      posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return 127;
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

// Total count of a callgrind profile; nullopt if the profile has none.
std::optional<double> Total(const std::string& profile) {
  std::ifstream in(profile);
  for (std::string line; std::getline(in, line);) {
    constexpr std::string_view kTotals = "totals: ";
    if (line.starts_with(kTotals)) return std::stod(line.substr(kTotals.size()));
  }
  return std::nullopt;
}

std::string LastLine(const std::string& path) {
  std::ifstream in(path);
  std::string last;
  for (std::string line; std::getline(in, line);) {
    if (!line.empty()) last = line;
  }
  return last;
}

InstructionCounts Problem(const std::string& text) { return {{}, text}; }

}  // namespace

InstructionCounts CountInstructions(const std::vector<std::string>& scenes, int feeds, bool quick,
                                    const std::string& folder) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  return Problem("valgrind cannot run a build with sanitizers");
#endif
  const std::filesystem::path program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "torquer-effect-ticks";
  if (!std::filesystem::exists(program)) {
    return Problem(program.string() + " does not exist; build it (host/build)");
  }
  const std::string log = folder + "/valgrind.log";
  const std::string profile = folder + "/profile";
  std::vector<std::string> words = {"valgrind",           "--tool=callgrind",
                                    "--instr-atstart=no", "--callgrind-out-file=" + profile,
                                    program.string(),     std::to_string(feeds)};
  if (quick) words.emplace_back("--quick");
  words.insert(words.end(), scenes.begin(), scenes.end());
  const int status = Run(words, log);
  if (status == 127) return Problem("valgrind is not installed (Debian: apt install valgrind)");
  if (status != 0)
    return Problem("valgrind ended with " + std::to_string(status) + ": " + LastLine(log));
  InstructionCounts counts;
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    // callgrind writes one profile for each request of the program.
    const std::optional<double> total = Total(profile + "." + std::to_string(k + 1));
    if (!total || *total <= 0) return Problem("valgrind counted nothing in " + scenes[k]);
    counts.per_tick.push_back(*total / feeds);
  }
  return counts;
}

}  // namespace torquer::study
