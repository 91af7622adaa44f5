// Program that runs the wire of drill_tube.toml on the core alone and prints a hash of its end
// state.
#include <cinttypes>
#include <cstdio>
#include <numbers>
#include <utility>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/vessel/phantoms.h"
#include "tests/effects/cost/drill.h"

int main() {
  using namespace torquer;
  const vessel::Tube tube{
      "tube",
      vessel::ArcLinePath::FromCorners(
          {{0, 0, 0}, {80, 0, 0}, {150, 50, 0}, {230, 50, 30}, {300, 50, 30}}, 40),
      {3},
      {0}};
  vessel::TubeVessel vessel = vessel::MakeTubeVessel({tube}, 2, 1);
  const auto bricks = vessel::MakeTubeBricks(std::move(vessel.field));
  const vessel::CenterlineSample entry = vessel.centerlines.curves()[0].At(1);
  const double bend = std::numbers::pi / 180 * 30 / (10.0 * 1);
  const std::vector<WireSection> sections = {{0, 1, 0.4445, bend, 0},
                                             {10, 1, 0.4445, bend, 0},
                                             {10 + 1e-6, 1, 0.4445, 0, 0},
                                             {15, 1, 0.4445, 0, 0},
                                             {80, 40, 0.4445, 0, 0}};
  const WireModel model(1, sections, 10, 280, BendingLaw::kExact,
                        {entry.position_mm, entry.tangent.normalized()});
  const WallModel wall{.stiffness_N_mm2 = 1};
  const std::vector<EnergyTerm*> none;
  NewtonRelaxation relaxation(model, *bricks, wall, NewtonSettings(), none);
  WireState state(model);
  relaxation.Restart(state);
  for (int k = 1; k <= test::kTicks; ++k) {
    CountedBudget budget(1000);
    relaxation.Tick({k * test::kFeedMm, k * test::kTurnRad}, budget, state);
  }
  std::printf("%016" PRIx64 "\n", relaxation.Hash(HashState(state)));
  return 0;
}
