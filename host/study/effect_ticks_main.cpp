// torquer-effect-ticks: runs ticks for torquer-study effects, which counts their instructions.
// Under callgrind with --instr-atstart=no the feeds of each scene give one profile.

#include <string>
#include <vector>

#include "host/study/effect_drive.h"
#include "host/support/number.h"
#include "host/support/program.h"

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#else
#define CALLGRIND_START_INSTRUMENTATION static_assert(true)
#define CALLGRIND_STOP_INSTRUMENTATION static_assert(true)
#define CALLGRIND_DUMP_STATS static_assert(true)
#endif

namespace {

struct Arguments {
  std::string feeds;
  bool quick = false;
  std::vector<std::string> scenes;
};

int Run(const Arguments& arguments) {
  constexpr double kMostFeeds = 1e6;
  const double feeds = torquer::ParseNumber(arguments.feeds).value_or(0);
  if (!(feeds >= 1 && feeds <= kMostFeeds)) {
    throw torquer::UsageError("FEEDS '" + arguments.feeds +
                              "' is not a number from 1 to 1000000; give the number of feeds");
  }
  for (const std::string& path : arguments.scenes) {
    torquer::scene::Scene scene(path);
    torquer::study::EffectDrive drive(
        scene, arguments.quick ? torquer::study::kDrivenQuickMm : torquer::study::kDrivenMm);
    drive.Insert(static_cast<int>(feeds));
    CALLGRIND_START_INSTRUMENTATION;
    for (int feed = 0; feed < static_cast<int>(feeds); ++feed) drive.Feed();
    CALLGRIND_STOP_INSTRUMENTATION;
    CALLGRIND_DUMP_STATS;
  }
  return torquer::kExitSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "torquer-effect-ticks",
      "Runs the ticks for which 'torquer-study effects' counts instructions under callgrind.");
  Arguments arguments;
  program.options().Flag("--quick", arguments.quick, "use a wire of 60 mm instead of 250 mm");
  program.options().Operand("FEEDS", arguments.feeds,
                            "number of feeds to count in each scene, 1 to 1000000",
                            torquer::ValueKind::kText);
  program.options().Operands("SCENE", arguments.scenes, "scene files to run");
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
