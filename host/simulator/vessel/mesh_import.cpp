#include "host/simulator/vessel/mesh_import.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <system_error>
#include <vector>

#include "host/simulator/vessel/file_descriptor.h"
#include "host/simulator/vessel/mesh_answer.h"
#include "host/support/error.h"
#include "host/support/input_file.h"
#include "host/support/installed.h"

namespace torquer::vessel {

namespace {

using Clock = std::chrono::steady_clock;

[[noreturn]] void Fail(const char* what, int error) {
  throw std::system_error(error, std::generic_category(), what);
}

// Makes `file` a file in memory with these bytes, at its beginning.
void Fill(FileDescriptor& file, const std::string& bytes) {
  file.Set(memfd_create("torquer-surface", MFD_CLOEXEC));
  if (file.number() < 0) Fail("memfd_create", errno);
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t put =
        pwrite(file.number(), bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) Fail("a file in memory", errno);
    done += static_cast<std::size_t>(put);
  }
}

// Hard limit of processor time of this process and its children, s, as of ulimit -t. Infinite
// without one.
double ProcessorLimitS() {
  rlimit limit{};
  if (getrlimit(RLIMIT_CPU, &limit) != 0 || limit.rlim_max == RLIM_INFINITY) {
    return std::numeric_limits<double>::infinity();
  }
  return static_cast<double>(limit.rlim_max);
}

// Attributes and actions of posix_spawn.
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

// Process that reads. The destructor kills it if it still runs.
class Reading {
 public:
  Reading(const MeshReader& reader, const std::string& contents, const std::string& path,
          double mm_per_unit)
      : reader_(reader),
        end_(Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                std::chrono::duration<double>(reader.clock_s))) {
    FileDescriptor input, writing;
    Fill(input, contents);
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) Fail("pipe2", errno);
    answer_.Set(ends[0]);
    writing.Set(ends[1]);
    Start(input.number(), writing.number(), path, mm_per_unit);
  }
  ~Reading() {
    if (child_ < 0) return;
    kill(-child_, SIGKILL);  // its group, with all processes that it started
    Reap(nullptr);
  }
  Reading(const Reading&) = delete;
  Reading& operator=(const Reading&) = delete;

  enum class Ending { kAnswered, kCrashed, kTooLong, kTooLongByClock, kLimited, kTooMuch };

  // Collects its output until it ends or exceeds a limit.
  Ending Wait(std::string& answer) {
    std::vector<char> buffer(std::size_t{1} << 16);
    while (WaitFor(answer_.number())) {
      const ssize_t got = read(answer_.number(), buffer.data(), buffer.size());
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) Fail("read", errno);
      if (got == 0) return WaitForEnd();
      answer.append(buffer.data(), static_cast<std::size_t>(got));
      if (answer.size() > static_cast<std::size_t>(reader_.answer_bytes)) return Ending::kTooMuch;
    }
    return Ending::kTooLongByClock;
  }

 private:
  void Start(int input, int output, const std::string& path, double mm_per_unit) {
    Spawning spawning;
    posix_spawn_file_actions_adddup2(&spawning.actions, input, STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&spawning.actions, output, STDOUT_FILENO);
    posix_spawn_file_actions_addclosefrom_np(&spawning.actions, STDERR_FILENO + 1);
    // Own group: Ctrl-C in a terminal then goes to the program alone, which ends this process.
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_setpgroup(&spawning.attributes, 0);
    posix_spawnattr_setsigmask(&spawning.attributes, &none);
    posix_spawnattr_setsigdefault(&spawning.attributes, &all);
    posix_spawnattr_setflags(&spawning.attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK |
                                                       POSIX_SPAWN_SETSIGDEF);
    std::vector<std::string> words = {reader_.program, path, fmt::format("{}", mm_per_unit),
                                      std::to_string(reader_.memory_bytes),
                                      std::to_string(std::llround(std::ceil(reader_.cpu_s)))};
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const int error = posix_spawn(&child_, reader_.program.c_str(), &spawning.actions,
                                  &spawning.attributes, argv.data(), environ);
    if (error == 0) return;
    child_ = -1;
    throw UserError(
        fmt::format("{}: cannot be read: {} cannot be started ({}); build it: host/build", path,
                    reader_.program, std::strerror(error)));
  }

  // True if `file` is readable or the process has ended; false when its time is over.
  bool WaitFor(int file) const {
    for (;;) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(end_ - Clock::now()).count();
      if (left <= 0) return false;
      pollfd event{file, POLLIN, 0};
      const int ready = poll(&event, 1, static_cast<int>(std::min<std::int64_t>(left, 60000)));
      if (ready > 0) return true;
      if (ready < 0 && errno != EINTR) Fail("poll", errno);
    }
  }

  Ending WaitForEnd() {
    const FileDescriptor process(static_cast<int>(syscall(SYS_pidfd_open, child_, 0)));
    if (process.number() >= 0 && !WaitFor(process.number())) {
      return Ending::kTooLongByClock;
    }
    int status = 0;
    if (!Reap(&status)) return Ending::kAnswered;  // the answer itself shows if it is complete
    const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
    // A hard limit may kill at once.
    const bool limited = ProcessorLimitS() <= std::ceil(reader_.cpu_s);
    if (limited && (signal == SIGXCPU || signal == SIGKILL)) return Ending::kLimited;
    if (signal == SIGXCPU) return Ending::kTooLong;
    return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? Ending::kAnswered : Ending::kCrashed;
  }

  bool Reap(int* status) {
    pid_t got = -1;
    while ((got = waitpid(child_, status, 0)) < 0 && errno == EINTR) {
    }
    child_ = -1;
    return got >= 0;
  }

  const MeshReader& reader_;
  Clock::time_point end_;
  FileDescriptor answer_;
  pid_t child_ = -1;
};

}  // namespace

std::string MeshReaderPath() { return FindInstalled("libexec/torquer/torquer-mesh-reader"); }

MeshReader MeshReader::For(std::size_t file_bytes) {
  const auto bytes = static_cast<std::int64_t>(file_bytes);
  const double seconds = 20 + 2e-6 * static_cast<double>(file_bytes);
  MeshReader reader;
  reader.memory_bytes = (std::int64_t{512} << 20) + 32 * bytes;
  reader.answer_bytes = (std::int64_t{1} << 16) + 24 * bytes;
  reader.cpu_s = seconds;
  reader.clock_s = 3 * seconds;
  return reader;
}

std::string ReadMeshContents(const std::string& path) {
  return ReadInputFile(path, "check the path of the surface in the scene, and its permissions");
}

TriangleMesh ImportMesh(const std::string& contents, const std::string& path, double mm_per_unit,
                        const MeshReader& reader) {
  std::string answer;
  Reading reading(reader, contents, path, mm_per_unit);
  const Reading::Ending ending = reading.Wait(answer);
  if (ending == Reading::Ending::kAnswered) return MeshOfAnswer(answer, path);
  using Ending = Reading::Ending;
  if (ending == Ending::kLimited) {
    throw UserError(fmt::format(
        "{}: the surface reader needs more than the {:g} s of processor time that a program may "
        "take here; raise the limit of processor time (ulimit -t), or give fewer triangles",
        path, ProcessorLimitS()));
  }
  const std::string what =
      ending == Ending::kCrashed ? "crashed"
      : ending == Ending::kTooLong
          ? fmt::format("did not end within {:g} s of processor time", reader.cpu_s)
      : ending == Ending::kTooLongByClock ? fmt::format("did not end within {:g} s", reader.clock_s)
                                          : "returned more triangles than the file can hold";
  throw UserError(fmt::format(
      "{}: the surface reader {}; the file is damaged: export it again, preferably as .obj", path,
      what));
}

TriangleMesh ImportMesh(const std::string& contents, const std::string& path, double mm_per_unit) {
  return ImportMesh(contents, path, mm_per_unit, MeshReader::For(contents.size()));
}

}  // namespace torquer::vessel
