// Interrupt test: Ctrl-C or SIGTERM ends a program during a long computation, before it finishes.
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <fstream>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {
namespace {

struct LongWork {
  const char* name;
  std::vector<std::string> words;
};

// Computations of hours, and long start-up work before a program serves requests.
std::vector<LongWork> LongWorks(const TemporaryFolder& folder) {
  const std::string script = folder.Path("long.csv");
  std::ofstream(script) << "time_s,guidewire.insertion_mm\n0,0\n1e7,100\n";
  const std::string simulator = ProgramPath("torquer-simulator");
  const std::string everything = SourcePath("/host/scenes/everything.toml");
  return {
      {"one long row",
       {simulator, "--scene", everything, "--script", script, "--states",
        folder.Path("states.jsonl")}},
      {"field of a surface", {simulator, "--explain", everything}},
      {"surface for a page", {ProgramPath("torquer-viewer"), "--scene", everything}},
      {"study", {ProgramPath("torquer-study"), "torture", "--seconds", "100000"}},
  };
}

}  // namespace

TEST_CASE("Ctrl-C ends a program in the middle of long work") {
  NeedPrivateNetwork();
  const TemporaryFolder folder;
  setenv("XDG_CACHE_HOME", folder.Path("cache").c_str(), 1);
  constexpr unsigned kSeed = 20261125;
  CAPTURE(kSeed);
  std::mt19937 random(kSeed);
  std::uniform_real_distribution<double> moment_s(0.05, 0.25);
  for (const LongWork& work : LongWorks(folder)) {
    for (const int signal : {SIGINT, SIGTERM}) {
      const double after_s = moment_s(random);
      CAPTURE(work.name, signal, after_s);
      ChildProcess process(work.words);
      std::this_thread::sleep_for(std::chrono::duration<double>(after_s));
      process.Signal(signal);
      // Waits for minutes at most; the computation would take hours.
      const int status = process.Wait();
      CAPTURE(process.Error(), process.Output());
      CHECK((status == 128 + signal || status == 1));
      // The signal arrived during start-up: the page was not served yet.
      CHECK(process.Output().find("http://") == std::string::npos);
    }
  }
  unsetenv("XDG_CACHE_HOME");
}

}  // namespace torquer::test
