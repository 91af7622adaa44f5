#include "host/simulator/vessel/reading_filter.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <vector>

#include "catch2/catch.hpp"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"

namespace torquer::vessel {
namespace {

// Exit status of `body` in a child process behind the filter; -1 if a signal ended it.
template <class Body>
int Behind(Body body) {
  const pid_t child = fork();
  if (child == 0) {
    signal(SIGABRT, SIG_DFL);  // Catch's handler would report this process as the test
    if (!AllowOnlyReading()) _exit(77);
    _exit(body());
  }
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

bool Refused(long result) { return result == -1 && errno == EPERM; }

TEST_CASE("The filter forbids to open, connect, start and signal") {
  REQUIRE(Behind([] { return 0; }) == 0);
  CHECK(Behind([] { return Refused(open("/dev/null", O_RDONLY)) ? 0 : 1; }) == 0);
  CHECK(Behind([] { return Refused(open("/dev/null", O_WRONLY)) ? 0 : 1; }) == 0);
  CHECK(Behind([] { return Refused(socket(AF_INET, SOCK_STREAM, 0)) ? 0 : 1; }) == 0);
  CHECK(Behind([] { return Refused(socket(AF_UNIX, SOCK_DGRAM, 0)) ? 0 : 1; }) == 0);
  CHECK(Behind([] { return Refused(syscall(SYS_fork)) ? 0 : 1; }) == 0);
  CHECK(Behind([] { return Refused(execl("/bin/true", "true", nullptr)) ? 0 : 1; }) == 0);
  CHECK(Behind([] { return Refused(unlink("/nowhere")) ? 0 : 1; }) == 0);
  CHECK(Behind([] { return Refused(kill(getppid(), 0)) ? 0 : 1; }) == 0);
  CHECK(Behind([] { return Refused(syscall(SYS_tgkill, getppid(), getppid(), 0)) ? 0 : 1; }) == 0);
  CHECK(Behind([] { return Refused(syscall(SYS_ptrace, 0, 0, 0, 0)) ? 0 : 1; }) == 0);
}

TEST_CASE("Behind the filter memory and open files work, and abort() ends the process") {
  int ends[2];
  REQUIRE(pipe(ends) == 0);
  CHECK(Behind([&ends] {
          // Small and large blocks, for both ways of allocating memory.
          std::vector<std::vector<char>> blocks;
          for (std::size_t bytes = 16; bytes < 100'000'000; bytes *= 3) blocks.emplace_back(bytes);
          blocks.clear();
          return write(ends[1], "x", 1) == 1 ? 0 : 1;
        }) == 0);
  char byte = 0;
  CHECK(read(ends[0], &byte, 1) == 1);
  CHECK(byte == 'x');
  close(ends[0]);
  close(ends[1]);
  CHECK(Behind([]() -> int { std::abort(); }) == -1);
}

TEST_CASE("The reader of surfaces is behind the filter before it reads its file") {
  int input[2];
  REQUIRE(pipe(input) == 0);
  const pid_t reader = fork();
  if (reader == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    dup2(input[0], STDIN_FILENO);
    dup2(open("/dev/null", O_WRONLY | O_CLOEXEC), STDOUT_FILENO);  // writing files is forbidden
    close(input[0]);
    close(input[1]);
    execl(test::ProgramPath("helpers/torquer-mesh-reader").c_str(), "torquer-mesh-reader", "a.stl",
          "1", "1000000000", "10", nullptr);
    _exit(1);
  }
  close(input[0]);
  bool behind = false;
  for (int i = 0; i < 5000 && !behind; ++i) {
    const std::string status = test::Contents("/proc/" + std::to_string(reader) + "/status");
    behind = status.find("Seccomp:\t2") != std::string::npos;
    usleep(1000);
  }
  CHECK(behind);
  close(input[1]);  // an empty file: the reader answers and exits
  int status = 0;
  REQUIRE(waitpid(reader, &status, 0) == reader);
  CHECK(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 0);
}

}  // namespace
}  // namespace torquer::vessel
