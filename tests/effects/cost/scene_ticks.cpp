// Program that runs a scene's ticks as a session does and prints a hash of the wire's end state.
// usage: scene_ticks SCENE [TICKS]
#include <cinttypes>
#include <cstdio>
#include <cstdlib>

#include "host/simulator/simulation.h"
#include "tests/effects/cost/drill.h"

int main(int argc, char** argv) {
  using namespace torquer;
  if (argc != 2 && argc != 3) return 2;
  const int ticks = argc == 3 ? std::atoi(argv[2]) : test::kTicks;
  scene::Scene scene(argv[1]);
  simulator::Simulation session(scene);
  simulator::Command command;
  const InstrumentPoses start = session.target();
  for (int k = 1; k <= ticks; ++k) {
    command.time_s = k * test::kTickS;
    command.target = start;
    command.target[0] = {start[0].insertion_mm + k * test::kFeedMm, k * test::kTurnRad};
    CountedBudget budget(scene.budget_units());
    session.Tick(command, budget);
  }
  std::printf("%016" PRIx64 "\n", session.state_hash());
  return 0;
}
