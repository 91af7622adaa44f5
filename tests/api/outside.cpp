// Example program outside this tree: it uses installed files only.
#include <torquer/torquer.h>

#include <cstdio>
int main(int, char** argv) {
  try {
    torquer::Simulation simulation(torquer::Scene::FromFile(argv[1]));
    torquer::Command command = simulation.command();
    for (int k = 1; k <= 3; ++k) {
      command.time_s = 0.1 * k;
      command.hands[0].insertion_mm += 1;
      double latest_s = 0;
      const auto look = [&](const torquer::StepReport& tick) {
        latest_s = simulation.time_s();
        return tick.converged;
      };
      if (!simulation.Step(command, look).finished || latest_s != command.time_s) return 1;
    }
    std::printf("%s %.0f\n", torquer::Version(), simulation.instruments()[0].hand.insertion_mm);
  } catch (const torquer::Error& error) {
    std::printf("refused: %s\n", error.what());
    return 2;
  }
}
