// Nested instruments in free space.
#pragma once

#include <catch2/catch.hpp>
#include <memory>
#include <utility>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {

inline constexpr double kArcSegmentMm = 0.5;

/// Instrument whose rest shape is an arc; it does not twist if its torsional rigidity is 0.
inline WireModel Arc(double rigidity, double curvature, double radius, double torsional_N_mm2 = 0,
                     double segment_mm = kArcSegmentMm) {
  return WireModel(segment_mm, {{0, rigidity, radius, curvature, 0, torsional_N_mm2}}, 0, 80,
                   BendingLaw::kExact, {});
}

/// Checks that a distance in mm is proportional to 1/GJ. `apart_mm` gives it by the ratio of GJ to
/// EI.
template <class Apart>
void CheckFallsAsCompliance(Apart apart_mm) {
  double before_mm = 0;
  for (const double ratio : {10.0, 100.0, 1000.0}) {
    const double now_mm = apart_mm(ratio);
    CAPTURE(ratio, now_mm);
    if (before_mm > 0) CHECK(now_mm == Approx(before_mm / 10).epsilon(0.1));
    before_mm = now_mm;
  }
  CHECK(before_mm < 0.05);
}

/// Stack with the innermost instrument first.
struct FreeStack {
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall;
  std::vector<EnergyTerm*> none;
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  explicit FreeStack(std::vector<WireModel> instruments)
      : stack(std::move(instruments)),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, none)),
        state(stack.empty_rod(), stack.size()) {
    relaxation->Restart(state);
  }
  void MoveTo(const InstrumentPoses& target) {
    const TickReport report = Settle(*relaxation, target, state, 400);
    REQUIRE(report.converged);
    REQUIRE(report.arrived());
    REQUIRE_FALSE(report.budget_spent);
  }
};

}  // namespace torquer::test
