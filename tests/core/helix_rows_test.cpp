// Simultaneous feeding and turning: the path must not depend on how it is divided into rows.
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// A wire with a bent tip, alone or in a catheter, with friction in a curved vessel.
struct Screwed {
  Torus field{Side::kInside, 30, 4};
  WallModel wall{.stiffness_N_mm2 = 0.1};
  InstrumentStack stack;
  effects::Friction friction;
  std::vector<EnergyTerm*> terms{&friction};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  static std::vector<WireModel> Instruments(int count) {
    const Sheath sheath{Vector3d(30, 0, 0), Vector3d::UnitY()};
    std::vector<WireModel> instruments;
    instruments.push_back(MakeWire(
        {.radius_mm = 0.2, .tip_mm = 12, .tip_curvature_1_per_mm = 0.08, .sheath = sheath}));
    if (count > 1) {
      instruments.push_back(MakeWire({.rigidity_N_mm2 = 0.02,
                                      .radius_mm = 0.5,
                                      .tip_mm = 8,
                                      .tip_curvature_1_per_mm = 0.03,
                                      .sheath = sheath}));
    }
    return instruments;
  }
  effects::EffectContext Context() const {
    effects::EffectContext context{stack.empty_rod(), wall};
    context.instruments.resize(static_cast<std::size_t>(stack.size()));
    return context;
  }
  explicit Screwed(int count)
      : stack(Instruments(count)),
        friction(0.2, 0.005, Context()),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {}, terms)),
        state(stack.empty_rod(), count) {
    relaxation->Restart(state);
    InstrumentPoses start(count);
    for (int k = 0; k < count; ++k) start[k].insertion_mm = 20 - 5.0 * k;
    REQUIRE(Settle(*relaxation, start, state, 300).converged);
  }
  void Go(double feed_mm, double turn_rad, int rows) {
    const InstrumentPoses start = state.poses();
    for (int row = 1; row <= rows; ++row) {
      InstrumentPoses target = start;
      for (int k = 0; k < stack.size(); ++k) {
        // The catheter follows more slowly and turns in the other direction.
        const double part = (k == 0 ? 1.0 : 0.6) * row / rows;
        target[k].insertion_mm += part * feed_mm;
        target[k].rotation_rad += (k == 0 ? 1 : -1) * part * turn_rad;
      }
      REQUIRE(Settle(*relaxation, target, state, 300).converged);
    }
  }
};

TEST_CASE("A wire fed and turned together takes the same path in one row and in many") {
  const int count = GENERATE(1, 2);
  struct Way {
    double feed_mm;
    double turn_rad;
    int rows;  // rows of about one part each
  };
  const Way way = GENERATE(Way{30, 6, 120}, Way{6, 7, 35}, Way{-10, 5, 40}, Way{0.5, -9, 45});
  CAPTURE(count, way.feed_mm, way.turn_rad);
  Screwed many(count);
  many.Go(way.feed_mm, way.turn_rad, way.rows);
  for (const int rows : {1, 5}) {
    Screwed few(count);
    few.Go(way.feed_mm, way.turn_rad, rows);
    CHECK(LargestDistance(few.state, many.state) < 0.02);
  }
}

TEST_CASE("Feeds and turns of all instruments arrive together, and stop where the lead changes") {
  const InstrumentStack stack(Screwed::Instruments(2));
  const InstrumentPoses here{{20, 0.5}, {15, -1}};
  const InstrumentPoses turning = stack.Towards({{21, 4.5}, {14.5, -2}}, here, 0.25, 0.2);
  CHECK(turning[0].rotation_rad == 0.7);  // a twentieth of the path
  CHECK(turning[0].insertion_mm == Approx(20.05));
  CHECK(turning[1].insertion_mm == Approx(14.975));
  CHECK(turning[1].rotation_rad == Approx(-1.05));
  const InstrumentPoses feeding = stack.Towards({{25, 0.6}, {15, -1}}, here, 0.25, 0.2);
  CHECK(feeding[0].insertion_mm == 20.25);
  CHECK(feeding[0].rotation_rad == Approx(0.505));
  CHECK(feeding[1] == here[1]);
  // The catheter passes the wire halfway.
  const InstrumentPoses near{{15.1, 0}, {15, 0}};
  const InstrumentPoses beside = stack.Towards({{15.1, 0}, {15.2, 0.1}}, near, 0.25, 0.2);
  CHECK(beside[1].insertion_mm == beside[0].insertion_mm);
  CHECK(beside[1].rotation_rad == Approx(0.05));
  const InstrumentPoses goal{{15.2, 0.1}, {15.1, -0.2}};
  CHECK(stack.Towards(goal, near, 0.25, 0.2) == goal);
}

}  // namespace
}  // namespace torquer::test
