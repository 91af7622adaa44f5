#include "host/bus/claim.h"

#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/temporary_folder.h"

using torquer::bus::Claim;
using torquer::bus::ClaimHolder;
using torquer::bus::SignalClaimHolder;

namespace {

// Child process that holds the claim `name` (none if ""), and exits with 7 on SIGUSR1.
class Holder {
 public:
  explicit Holder(const std::string& name) {
    int ready[2];
    REQUIRE(pipe(ready) == 0);
    pid_ = fork();
    REQUIRE(pid_ >= 0);
    if (pid_ == 0) {
      std::signal(SIGUSR1, [](int) { _exit(7); });
      alarm(60);
      if (!name.empty()) new Claim(name, {.what = "the claim"});
      static_cast<void>(!write(ready[1], "x", 1));
      for (;;) pause();
    }
    char byte = 0;
    REQUIRE(read(ready[0], &byte, 1) == 1);
    close(ready[0]);
    close(ready[1]);
  }
  ~Holder() {
    if (ended_) return;
    kill(pid_, SIGKILL);
    Wait();
  }
  Holder(const Holder&) = delete;
  Holder& operator=(const Holder&) = delete;

  pid_t pid() const { return pid_; }
  int Wait() {
    int status = 0;
    waitpid(pid_, &status, 0);
    ended_ = true;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  pid_t pid_ = -1;
  bool ended_ = false;
};

}  // namespace

TEST_CASE("Only the holder of a claim is signaled, also with a forged file") {
  const torquer::test::TemporaryFolder folder;
  setenv("XDG_RUNTIME_DIR", folder.Path().c_str(), 1);
  const std::string name = "test.claim";
  const std::string file = folder.Path("torquer/" + name);
  CHECK_FALSE(SignalClaimHolder(name, SIGUSR1));
  // SIGUSR1 to the whole group would end this process too.
  Holder stranger("");
  std::string number;
  SECTION("the stranger's number") { number = std::to_string(stranger.pid()); }
  SECTION("no number") { number = "?"; }
  SECTION("the own group's") { number = "0"; }
  SECTION("everybody's") { number = "-1"; }
  {
    Holder holder(name);
    CHECK(ClaimHolder(name) == holder.pid());
    std::ofstream(file, std::ios::in | std::ios::out) << number << "\n";
    CHECK(ClaimHolder(name) == holder.pid());
    CHECK(SignalClaimHolder(name, SIGUSR1));
    CHECK(holder.Wait() == 7);
  }
  CHECK(std::filesystem::exists(file));
  CHECK_FALSE(ClaimHolder(name));
  CHECK_FALSE(SignalClaimHolder(name, SIGUSR1));
  CHECK(kill(stranger.pid(), 0) == 0);
  kill(stranger.pid(), SIGUSR1);
  CHECK(stranger.Wait() == 7);
  unsetenv("XDG_RUNTIME_DIR");
}
