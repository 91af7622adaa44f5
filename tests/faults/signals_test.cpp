// Signals at random moments to every program: it ends by itself or by that signal. Every file is
// unchanged or complete.
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <random>
#include <string>
#include <thread>
#include <utility>

#include "host/support/event_log.h"
#include "tests/faults/writer.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"

namespace torquer::test {
namespace {

using Clock = std::chrono::steady_clock;

constexpr unsigned kSeed = 20261123;
constexpr int kMoments = 5;
const std::pair<const char*, int> kSignals[] = {
    {"HUP", SIGHUP}, {"INT", SIGINT}, {"TERM", SIGTERM}, {"PIPE", SIGPIPE}};

// Programs that run until a signal, in addition to the writers.
std::vector<Writer> Sessions() {
  const std::string scene = SourcePath("/host/scenes/ty_phantom.toml");
  return {
      {.name = "torquer-simulator, live",
       .words = {ProgramPath("torquer-simulator"), "--scene", scene},
       .outputs = 0,
       .stays = true},
      {.name = "torquer-monitor",
       .words = {ProgramPath("torquer-monitor")},
       .outputs = 0,
       .stays = true},
      {.name = "torquer-recorder",
       .words = {ProgramPath("torquer-recorder"), "@/log"},
       .stays = true,
       .whole = [](const std::string&) { return true; }},
  };
}

void CheckSignals(const Writer& writer, bool in_order, std::mt19937& random) {
  FilesByName reference;
  const auto start = Clock::now();
  {
    const WriterBench bench(writer);
    const WriterRun run = bench.With({});
    INFO(run.said);
    REQUIRE(run.status == 0);
    reference = bench.Files();
  }
  const std::chrono::duration<double> whole = Clock::now() - start;
  std::uniform_real_distribution<double> moment_s(0, 1.1 * whole.count());
  for (const auto& [name, signal] : kSignals) {
    for (int k = 0; k < kMoments; ++k) {
      const double after_s = moment_s(random);
      const WriterBench bench(writer);
      ChildProcess process(bench.Command());
      std::this_thread::sleep_for(std::chrono::duration<double>(after_s));
      process.Signal(signal);
      if (writer.stays && signal == SIGPIPE) process.Signal(SIGTERM);
      const int status = process.Wait();
      const WriterRun run{status, process.Error()};
      INFO(name << " after " << after_s << " s: status " << status << "\n" << run.said);
      const bool by_signal = status == 128 + signal || (writer.stays && status == 128 + SIGTERM);
      // Exit status of torquer-calibrate when the user gives up.
      constexpr int kGivenUp = 130;
      CHECK((status == 0 || status == 1 || status == kGivenUp || by_signal));
      const FilesByName files = bench.Files();
      CheckFiles(writer, files, reference, by_signal, run);
      if (status == 0) CHECK(AllWhole(writer, files, reference));
      // From its first file on, a session handles the signal and ends in order.
      if (in_order && status == 128 + signal && signal != SIGPIPE) CHECK(files.empty());
    }
  }
}

}  // namespace

TEST_CASE("After a signal at any time, every file is the old one or complete") {
  NeedPrivateNetwork();
  INFO("seed " << kSeed);
  std::mt19937 random(kSeed);
  for (const Writer& writer : Writers()) {
    DYNAMIC_SECTION(writer.name) { CheckSignals(writer, false, random); }
  }
}

TEST_CASE("Every session ends properly after a signal at any time") {
  NeedPrivateNetwork();
  INFO("seed " << kSeed);
  std::mt19937 random(kSeed);
  for (const Writer& writer : Sessions()) {
    DYNAMIC_SECTION(writer.name) { CheckSignals(writer, true, random); }
  }
}

}  // namespace torquer::test
