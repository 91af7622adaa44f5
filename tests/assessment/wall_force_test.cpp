#include "host/simulator/effects/wall_force.h"

#include <catch2/catch.hpp>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

double ReadingOf(const effects::Observer& observer, const std::string& name) {
  for (const effects::Reading& reading : observer.Readings()) {
    if (reading.name == name) return reading.value;
  }
  FAIL("no reading " << name);
  return 0;
}

TEST_CASE("A wire across a slit presses on the wall with the beam's force") {
  // Clamped in the middle of a slit and bent to its wall by its own rest curvature: a cantilever of
  // length L whose end is held back. At the tip P L^3 / (3 EI) = deflection free - deflection held.
  const double length = 30;
  const double rigidity = 6.35e-3;
  const double curvature = 0.004;
  const double half_gap = 0.8;
  const WireModel model = MakeWire({.segment_mm = 0.5,
                                    .rigidity_N_mm2 = rigidity,
                                    .tip_mm = length,
                                    .tip_curvature_1_per_mm = curvature,
                                    .max_length_mm = length});
  const Cylinder field(Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), half_gap);
  const WallModel wall{.stiffness_N_mm2 = 10, .points_per_segment = 2};
  const std::vector<EnergyTerm*> none;
  NewtonRelaxation relaxation(model, field, wall, {.tolerance = 1e-9}, none);
  WireState state = LayStraight(model, length);
  relaxation.Restart(state);
  CountedBudget budget(100000);
  const HandTarget target{length, 0};
  const TickReport report = relaxation.Tick(target, budget, state);
  REQUIRE(report.converged);

  effects::WallForce force(0.05, 5);
  const effects::Controls controls;
  const effects::TickView tick{.time_s = 0.5,
                               .step_s = 0.5,
                               .controls = controls,
                               .target = target,
                               .state = state,
                               .expansion = relaxation.Current(),
                               .report = report};
  force.Observe(tick);
  const double held = half_gap - model.radius_mm(0);
  const double free = curvature * length * length / 2;
  const double expected_mN = 1e3 * 3 * rigidity * (free - held) / (length * length * length);
  CHECK(force.sum_mN() == Approx(expected_mN).epsilon(0.03));
  // All of it near the tip, where alone it touches.
  CHECK(force.tip_mN() == Approx(force.sum_mN()));
  CHECK(force.largest_mN() <= force.sum_mN());
  CHECK(force.impulse_mNs() == Approx(0.5 * force.sum_mN()));
  CHECK(force.events() == (force.largest_mN() > 0.05 ? 1 : 0));

  // Passed once, it is one event however long it lasts.
  force.Observe(tick);
  CHECK(force.events() <= 1);
  CHECK(ReadingOf(force, "wall_force_largest_ever_mN") == force.largest_mN());
  force.Restart();
  CHECK(force.largest_ever_mN() == 0);
}

TEST_CASE("An event begins above the threshold, and keeps its largest force") {
  const WireModel model = MakeWire({});
  const WireState state(model);
  Expansion expansion;
  PointSet& points = expansion.points;
  points = PressedPoint(0);
  const effects::Controls controls;
  const HandTarget target;
  const TickReport report;
  effects::WallForce force(10, 5);
  double time_s = 0;
  const auto press = [&](double force_mN) {
    points.clearance[0].clearance_mm = 0.2 - 1e-3 * force_mN;
    force.Observe({.time_s = time_s += 0.25,
                   .step_s = 0.25,
                   .controls = controls,
                   .target = target,
                   .state = state,
                   .expansion = expansion,
                   .report = report});
  };
  press(8);
  CHECK(force.events() == 0);
  CHECK(force.event_began_s() == -1);
  for (const double force_mN : {12.0, 30.0, 15.0}) press(force_mN);  // at 0.5, 0.75 and 1 s
  CHECK(force.events() == 1);
  CHECK(force.event_began_s() == 0.5);
  CHECK(force.event_mN() == Approx(30));
  CHECK(force.seconds_above() == 0.75);
  press(5);
  press(20);
  press(4);
  CHECK(force.events() == 2);
  CHECK(ReadingOf(force, "wall_force_event_s") == 1.5);
  CHECK(ReadingOf(force, "wall_force_event_mN") == Approx(20));
  CHECK(force.largest_ever_mN() == Approx(30));
  force.Restart();
  CHECK(force.event_began_s() == -1);
  CHECK(force.event_mN() == 0);
}

}  // namespace
}  // namespace torquer::test
