// torquer-effect-ticks FEEDS SCENE...: the ticks whose instructions torquer-study effects counts.
// Under callgrind with --instr-atstart=no there is a profile for the feeds of each scene.

#include <cstdio>
#include <cstdlib>

#include "host/study/effect_drive.h"
#include "host/support/error.h"
#include "host/support/program.h"

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#else
#define CALLGRIND_START_INSTRUMENTATION static_assert(true)
#define CALLGRIND_STOP_INSTRUMENTATION static_assert(true)
#define CALLGRIND_DUMP_STATS static_assert(true)
#endif

int main(int argc, char** argv) {
  const int feeds = argc < 3 ? 0 : std::atoi(argv[1]);
  if (feeds < 1) {
    std::fprintf(stderr, "usage: torquer-effect-ticks FEEDS SCENE...\n");
    return torquer::kExitUserError;
  }
  try {
    for (int k = 2; k < argc; ++k) {
      torquer::scene::Scene scene(argv[k]);
      torquer::study::EffectDrive drive(scene);
      drive.Insert(feeds);
      CALLGRIND_START_INSTRUMENTATION;
      for (int feed = 0; feed < feeds; ++feed) drive.Feed();
      CALLGRIND_STOP_INSTRUMENTATION;
      CALLGRIND_DUMP_STATS;
    }
  } catch (const torquer::UserError& error) {
    std::fprintf(stderr, "torquer-effect-ticks: %s\n", error.what());
    return torquer::kExitUserError;
  }
  return 0;
}
