// Work of the solver on a soft wire that is drawn back and forth in a bend with friction.
#include <algorithm>
#include <catch2/catch.hpp>
#include <numeric>
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
  double segment_mm = 1;
  double longest_mm = 0.25;
  Torus field{Side::kInside, 160, 3};
  WallModel wall{.stiffness_N_mm2 = 1, .points_per_segment = 2};
  WireModel model = MakeWire({.segment_mm = segment_mm,
                              .rigidity_N_mm2 = 6.35e-3,
                              .radius_mm = 0.2,
                              .max_length_mm = 250,
                              .sheath = {Vector3d(160, 0, 0), Vector3d::UnitY()}});
  effects::Friction friction{0.1, 0.05, effects::EffectContext{model, wall}};
  std::vector<EnergyTerm*> terms{&friction};
  NewtonRelaxation relaxation{model, field, wall, {.max_feed_mm = longest_mm}, terms};
  WireState state{model};
  std::vector<int> solutions;  // of the model; by tick

  Strokes() { relaxation.Restart(state); }
  Strokes(double segments_mm, double parts_mm) : segment_mm(segments_mm), longest_mm(parts_mm) {
    relaxation.Restart(state);
  }

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

TEST_CASE("Short segments need no shorter parts of a motion") {
  // The wire touches the wall from 30 to 40 mm on.
  const double depth_mm = kUnderSanitizer ? 40 : 60;
  Strokes coarse(1, 0.25);
  Strokes fine(0.1, 0.25);
  Strokes often(0.1, 0.05);  // parts of half a segment
  double apart_mm = 0;
  for (const double drawn_mm : {0, 8, 0, 4}) {
    for (Strokes* strokes : {&coarse, &fine, &often}) strokes->DrawTo(depth_mm - drawn_mm, 0.5);
    apart_mm = std::max(apart_mm, LargestDistance(fine.state, often.state));
  }
  // Parts of half a segment are as far from those of an eighth.
  CHECK(apart_mm < 0.01);
  // They take twice as many solutions.
  const auto sum = [](const std::vector<int>& counts) {
    return std::accumulate(counts.begin(), counts.end(), 0.0);
  };
  CHECK(sum(coarse.solutions) > 100);
  CHECK(sum(fine.solutions) < 1.2 * sum(coarse.solutions));
}

}  // namespace
}  // namespace torquer::test
