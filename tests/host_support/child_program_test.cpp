#include "host/support/child_program.h"

#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

#include "host/support/error.h"
#include "tests/support/temporary_folder.h"

using torquer::ChildProgram;
using torquer::test::TemporaryFolder;

namespace {

std::vector<std::string> Shell(const std::string& script) { return {"/bin/sh", "-c", script}; }

int EndOf(ChildProgram& program) {
  for (int i = 0; i < 5000 && !program.Ended(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return program.Ended().value_or(-1);
}

std::string First(const std::string& path) {
  std::ifstream file(path);
  std::string word;
  file >> word;
  return word;
}

// Process id from a file, once it exists.
pid_t NumberIn(const std::string& path) {
  for (int i = 0; i < 5000 && First(path).empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return static_cast<pid_t>(std::stol(First(path)));
}

bool Gone(pid_t process) {
  for (int i = 0; i < 5000 && kill(process, 0) == 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return kill(process, 0) != 0;
}

}  // namespace

TEST_CASE("The end of a child and its output are reported, for any cause") {
  const TemporaryFolder folder;
  ChildProgram good(Shell("echo all is well; echo no error >&2"), folder.Path("good"));
  CHECK(EndOf(good) == 0);
  CHECK(good.LastOutput(1000) == "all is well\nno error\n");
  CHECK(good.LastOutput(6) == "error\n");
  ChildProgram bad(Shell("exit 3"), folder.Path("bad"));
  CHECK(EndOf(bad) == 3);
  CHECK(bad.LastOutput(1000).empty());
  ChildProgram killed(Shell("kill -USR1 $$"), folder.Path("killed"));
  CHECK(EndOf(killed) == 128 + SIGUSR1);
  ChildProgram asked({"/bin/sleep", "100"}, folder.Path("asked"));
  CHECK_FALSE(asked.Ended());
  asked.Signal(SIGTERM);
  CHECK(EndOf(asked) == 128 + SIGTERM);
  asked.Signal(SIGTERM);  // its process id is no longer valid
}

TEST_CASE("A child has no terminal's input, no open file and no mask of its parent") {
  const TemporaryFolder folder;
  sigset_t term, before;
  sigemptyset(&term);
  sigaddset(&term, SIGTERM);
  sigprocmask(SIG_BLOCK, &term, &before);
  ChildProgram child(Shell("cat; ls /proc/self/fd | tr '\\n' ' '; kill -TERM $$; sleep 9"),
                     folder.Path("output"));
  sigprocmask(SIG_SETMASK, &before, nullptr);
  CHECK(EndOf(child) == 128 + SIGTERM);
  CHECK(child.LastOutput(100) == "0 1 2 3 ");  // 3 is the folder that ls reads
}

TEST_CASE("A child that still runs ends with its owner, and with its parent") {
  const TemporaryFolder folder;
  pid_t number = 0;
  {
    const ChildProgram child(Shell("trap '' TERM; echo $$; while :; do sleep 0.01; done"),
                             folder.Path("owned"));
    number = NumberIn(folder.Path("owned"));
    CHECK(kill(number, 0) == 0);
  }
  CHECK(Gone(number));
  // A parent killed by SIGKILL cannot end its children itself.
  const pid_t parent = fork();
  if (parent == 0) {
    const ChildProgram child(Shell("echo $$; exec sleep 100"), folder.Path("left"));
    pause();
    _exit(0);
  }
  number = NumberIn(folder.Path("left"));
  CHECK(kill(number, 0) == 0);
  kill(parent, SIGKILL);
  waitpid(parent, nullptr, 0);
  CHECK(Gone(number));
}

TEST_CASE("A child that cannot start is refused by name") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(ChildProgram({"/nowhere/torquer-nothing"}, folder.Path("output")),
                    Catch::Contains("/nowhere/torquer-nothing: cannot be started: No such file"));
  CHECK_THROWS_WITH(ChildProgram(Shell("true"), folder.Path("no/output")),
                    Catch::Contains("no/output: cannot be written: No such file"));
}
