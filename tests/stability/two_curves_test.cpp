// Instruments with clearance in a lumen under random hand motion: they push, withdraw, pass each
// other and turn. Walls and lumens range from soft to hard.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <random>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/draws.h"
#include "tests/support/invariants.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// Two or three instruments in the bend of a vessel; half of these stacks twist. Rigidities and
// springs are drawn over decades.
struct Drawn {
  static constexpr double kLumen_mm[3] = {0, 0.3, 0.9};
  Torus field{Side::kInside, 20, 4};
  WallModel wall;
  InstrumentStack stack;
  std::vector<EnergyTerm*> none;
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  static std::vector<WireModel> Instruments(const Sheath& sheath, std::mt19937& random) {
    const int count = random() % 2 == 0 ? 2 : 3;
    const double radius_mm[3] = {Between(random, 0.1, 0.28), 0.5, 1.2};
    const double segment_mm = Between(random, 0.6, 2);
    const double ratio = random() % 2 == 0 ? 0 : Evenly(random, 0.1, 3);  // GJ / EI
    std::vector<WireModel> all;
    for (int k = 0; k < count; ++k) {
      const double rigidity = Evenly(random, 1e-4, 10);
      const double torsional = ratio * rigidity;
      all.push_back(
          WireModel(segment_mm,
                    {{0, rigidity, radius_mm[k], Between(random, -0.1, 0.1), 0, torsional},
                     {8, rigidity, radius_mm[k], Between(random, -0.1, 0.1), 0, torsional},
                     {8.01, 2 * rigidity, radius_mm[k], 0, 0, 2 * torsional}},
                    8, 90, BendingLaw::kExact, sheath));
    }
    return all;
  }
  // Lumen stiffness from that of the stiffest instrument upwards.
  // In three of four stacks of three, both lumens have room.
  static Clearance Room(const std::vector<WireModel>& instruments, std::mt19937& random) {
    double stiffest = 0;
    for (const WireModel& model : instruments) {
      stiffest = std::max(stiffest, model.rigidity_N_mm2(model.max_segments()));
    }
    const bool both = instruments.size() > 2 && random() % 4 != 0;
    return {.has_room = {false, true, both},
            .lumen_radius_mm = {kLumen_mm[0], kLumen_mm[1], kLumen_mm[2]},
            .stiffness_N_mm2 = Evenly(random, 3, 100) * stiffest};
  }

  explicit Drawn(std::mt19937& random)
      : Drawn(random, Instruments({Vector3d(20, 0, 0), Vector3d::UnitY()}, random)) {}
  Drawn(std::mt19937& random, const std::vector<WireModel>& instruments)
      : wall{.stiffness_N_mm2 = Evenly(random, 0.01, 100),
             .points_per_segment = static_cast<int>(1 + random() % 4)},
        stack(instruments, Room(instruments, random)),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {}, none)),
        state(stack.empty_rod(), stack.size()) {
    relaxation->Restart(state);
  }
};

void CheckCurves(const Drawn& drawn) {
  for (int c = 0; c < drawn.state.curves(); ++c) {
    const Curve& curve = drawn.state.curve(c);
    const WireModel& rod = drawn.stack.empty_rod(c);
    CAPTURE(c);
    CHECK_THAT(BrokenGeometry(rod, curve), Catch::Equals(""));
    // The curve reaches as far as its instruments.
    CHECK(curve.insertion_mm() == Approx(drawn.stack.Reach(c, curve.poses())).margin(1e-9));
  }
  CHECK(std::isfinite(drawn.relaxation->Current().energy_mJ));
}

TEST_CASE("Curves of instruments with room stay valid, for any hands") {
  const char* text = std::getenv("TORQUER_SEED");
  const unsigned first =
      text == nullptr ? 1 : static_cast<unsigned>(std::strtoul(text, nullptr, 10));
  for (unsigned seed = first; seed < first + static_cast<unsigned>(Rounds(12, 4)); ++seed) {
    INFO("TORQUER_SEED=" << seed);
    std::mt19937 random(seed);
    Drawn drawn(random);
    const int count = drawn.stack.size();
    InstrumentPoses goal(count);
    // When the second instrument is withdrawn, the wire lies in the third.
    const double room_mm = Drawn::kLumen_mm[count - 1] - drawn.stack.instrument(0).radius_mm(0);
    double offset_mm = 0;
    constexpr int kMoves = Rounds(40, 3);
    for (int move = 0; move < kMoves; ++move) {
      for (int k = 0; k < count; ++k) {
        goal[k].insertion_mm = std::max(0.0, goal[k].insertion_mm + Between(random, -6, 9));
        goal[k].rotation_rad += Between(random, -1, 1);
      }
      if (move == kMoves / 2) goal = InstrumentPoses(count);  // all out, then in again
      CountedBudget budget(static_cast<int>(20 + random() % 400));
      const TickReport report = drawn.relaxation->Tick(goal, budget, drawn.state);
      if (report.converged) {
        for (const BetweenCurves& between : drawn.relaxation->Current().between) {
          offset_mm = std::max(offset_mm, between.largest_offset_mm);
        }
      }
      CheckCurves(drawn);
    }
    // Finally all come to rest, and the inner instruments lie in the lumen.
    const TickReport report = Settle(*drawn.relaxation, drawn.stack.Bounded(goal), drawn.state, 60);
    CAPTURE(room_mm, offset_mm, report.residual, report.stalled);
    CHECK(report.arrived());
    CHECK(report.converged);
    CHECK(offset_mm < room_mm + 0.1);
  }
}

}  // namespace
}  // namespace torquer::test
