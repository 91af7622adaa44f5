// Disk failures for every program that writes files: each step fails in turn, or the process is
// killed there. The program must report it, and every file must be unchanged or complete.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <iterator>
#include <string>
#include <utility>

#include "tests/faults/writer.h"
#include "tests/support/private_network.h"

namespace torquer::test {
namespace {

constexpr const char* kFinalSteps[] = {"write", "pwrite", "fsync", "rename", "linkat"};

void CheckEveryStep(const Writer& writer) {
  const TemporaryFolder notes;
  FilesByName reference;
  {
    const WriterBench bench(writer);
    const WriterRun run = bench.With({});
    INFO(run.said);
    REQUIRE(run.status == 0);
    reference = bench.Files();
    REQUIRE(reference.size() >= writer.outputs);
  }
  const std::pair<const char*, int> kinds[] = {
      {"ENOSPC", ENOSPC}, {"EIO", EIO}, {"EACCES", EACCES}, {"EROFS", EROFS}, {"KILL", 0}};
  for (const auto& [kind, error] : kinds) {
    for (int at = 1;; ++at) {
      const WriterBench bench(writer);
      Fault fault{kind, at, bench.folder().Path(), notes.Path(kind + std::to_string(at))};
      const WriterRun run = bench.With(fault);
      const Words steps = Steps(fault);
      const auto files = bench.Files();
      const bool met = steps.size() >= static_cast<std::size_t>(at);
      INFO(kind << " at step " << at << ": " << (met ? steps[static_cast<std::size_t>(at) - 1] : "")
                << "\nstatus " << run.status << ": " << run.said);
      const bool could_not_remove =
          !steps.empty() && steps.back().starts_with("unlink") && std::string(kind) != "ENOSPC";
      CheckFiles(writer, files, reference, error == 0 || could_not_remove, run);
      if (!met) {
        CHECK(run.status == 0);
        CHECK(at > 1);
        break;
      }
      if (error == 0) {
        CHECK(run.status == 128 + SIGKILL);
        const bool refuses = writer.refuses_existing && AllWhole(writer, files, reference);
        const WriterRun next = bench.With({});
        INFO("the next run: " << next.said);
        CHECK(next.status == (refuses ? 2 : 0));
        if (refuses) CHECK_THAT(next.said, Catch::Contains("exists already"));
        CHECK(AllWhole(writer, bench.Files(), reference));
        continue;
      }
      if (run.status == 0) {
        // The program found an alternative, which must not exist for a failed write, sync or
        // rename.
        const std::string& step = steps[static_cast<std::size_t>(at) - 1];
        const bool final = std::any_of(std::begin(kFinalSteps), std::end(kFinalSteps),
                                       [&](const char* one) { return step.starts_with(one); });
        CHECK((writer.does_without || (!final && AllWhole(writer, files, reference))));
        if (AllWhole(writer, files, reference)) continue;
      } else {
        CHECK((run.status == 1 || run.status == 2));
      }
      CHECK_THAT(run.said, Catch::Contains(bench.folder().Path()));
      CHECK_THAT(run.said, Catch::Contains(std::strerror(error)));
    }
  }
}

}  // namespace

TEST_CASE("After a failure at any step, every file is the old one or complete") {
  NeedPrivateNetwork();
  for (const Writer& writer : Writers()) {
    DYNAMIC_SECTION(writer.name) { CheckEveryStep(writer); }
  }
}

}  // namespace torquer::test
