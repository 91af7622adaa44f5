// Work of the solver on a soft wire that is drawn back and forth in a bend with friction.
#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// Wire at the sheath of a ring of radius 160 mm, with a lumen of radius 3 mm.
struct Strokes {
  Torus field{Side::kInside, 160, 3};
  WallModel wall{.stiffness_N_mm2 = 1, .points_per_segment = 2};
  WireModel model = MakeWire({.segment_mm = 1,
                              .rigidity_N_mm2 = 6.35e-3,
                              .radius_mm = 0.2,
                              .max_length_mm = 250,
                              .sheath = {Vector3d(160, 0, 0), Vector3d::UnitY()}});
  effects::Friction friction{0.1, 0.05, effects::EffectContext{model, wall}};
  std::vector<EnergyTerm*> terms{&friction};
  NewtonRelaxation relaxation{model, field, wall, {}, terms};
  WireState state{model};
  std::vector<int> solutions;  // of the model; by tick

  Strokes() { relaxation.Restart(state); }

  // Moves the wire's end by ticks of `row_mm`.
  void DrawTo(double length_mm, double row_mm) {
    while (state.insertion_mm() != length_mm) {
      const double left_mm = length_mm - state.insertion_mm();
      std::vector<AttemptRecord> attempts;
      relaxation.Record(&attempts);
      CountedBudget budget(10000);
      const TickReport report = relaxation.Tick(
          {state.insertion_mm() + std::clamp(left_mm, -row_mm, row_mm), 0}, budget, state);
      relaxation.Record(nullptr);
      REQUIRE(report.converged);
      int count = 0;
      for (const AttemptRecord& one : attempts) count += one.active_set_rounds;
      solutions.push_back(count);
    }
  }
};

TEST_CASE("A command of many parts is split into equal ones") {
  Strokes strokes;
  strokes.DrawTo(10, 0.25);
  for (const double end_mm : {10.2, 10.4}) {
    CountedBudget one_part(1);
    strokes.relaxation.Tick({10.4, 0}, one_part, strokes.state);
    CHECK(strokes.state.insertion_mm() == Approx(end_mm).margin(1e-12));
    CountedBudget rest(1000);
    strokes.relaxation.Tick({strokes.state.insertion_mm(), 0}, rest, strokes.state);
  }
}

TEST_CASE("Long rows of strokes in a bend take few solutions, too") {
  Strokes strokes;
  const double depth_mm = kUnderSanitizer ? 60 : 240;
  strokes.DrawTo(depth_mm, 0.5);
  strokes.solutions.clear();
  for (int stroke = 0; stroke < 3; ++stroke) {
    strokes.DrawTo(depth_mm - 12.6, 0.7);
    strokes.DrawTo(depth_mm, 0.7);
  }
  double sum = 0;
  for (const int count : strokes.solutions) sum += count;
  // Long waves that a prediction repeats.
  CHECK(sum / static_cast<double>(strokes.solutions.size()) < 15);
}

TEST_CASE("A wire drawn back and forth in a bend takes few solutions of the model") {
  Strokes strokes;
  const double depth_mm = kUnderSanitizer ? 60 : 240;
  strokes.DrawTo(depth_mm, 0.4);
  for (const double stroke_mm : {8, 21, 13, 17, 9}) {
    strokes.DrawTo(depth_mm - stroke_mm, 0.4);
    strokes.DrawTo(depth_mm, 0.4);
  }
  double sum = 0;
  for (const int count : strokes.solutions) sum += count;
  // Sets of springs that cycle took 100 in the mean, and 1300 at a turn of the hand.
  CHECK(sum / static_cast<double>(strokes.solutions.size()) < 10);
  CHECK(*std::max_element(strokes.solutions.begin(), strokes.solutions.end()) < 200);
}

}  // namespace
}  // namespace torquer::test
