// A wire with room in a catheter, against beams with two supports.
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kWire_N_mm2 = 6.35e-3;
constexpr double kWireRadius_mm = 0.2;

WireModel Straight(double rigidity_N_mm2, double radius_mm, double segment_mm) {
  return WireModel(segment_mm, {{0, rigidity_N_mm2, radius_mm}}, 0, 120, BendingLaw::kExact, {});
}

// A wire in a catheter, in free space, with a force on the distal end.
struct Loose {
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall;
  EndForce force;
  std::vector<EnergyTerm*> terms{&force};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  Loose(std::vector<WireModel> instruments, double lumen_radius_mm, const Vector3d& force_N,
        int points_per_segment, double stiffness_N_mm2)
      : stack(std::move(instruments), {.first_outer = 1, .lumen_radius_mm = {0, lumen_radius_mm},
                                       .stiffness_N_mm2 = stiffness_N_mm2}),
        wall{.points_per_segment = points_per_segment},
        force(force_N),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, terms)),
        state(stack.rod(), 2) {
    relaxation->Restart(state);
  }
  int MoveTo(const InstrumentPlaces& target) {
    int iterations = 0;
    TickReport report;
    for (int k = 0; k < 400; ++k) {
      CountedBudget budget(100000);
      report = relaxation->Tick(target, budget, state);
      iterations += report.iterations;
      if (report.converged && report.arrived()) break;
    }
    REQUIRE(report.converged);
    return iterations;
  }
};

// Where a wire of the length `inside` in a rigid straight lumen with the room c to each side, and
// pushed across by F at the length b beyond the mouth, lies there. It rests on the mouth's edge on
// one side, and on the other side at the distance a behind it, where it is along the lumen.
double DeflectionBeyondMouth(double EI, double c, double inside, double b, double F) {
  const auto apart = [&](double a) {
    const double before = inside - a;  // clamped in the middle, and to the wall
    const double at_touch = 6 * EI * c / (before * before);
    return a * a * (2 * at_touch + F * b) / (6 * EI) - 2 * c;
  };
  double low = 0;
  double high = inside * 0.99;
  for (int k = 0; k < 100; ++k) {
    const double mid = (low + high) / 2;
    (apart(mid) < 0 ? low : high) = mid;
  }
  const double a = low;
  const double at_touch = 6 * EI * c / ((inside - a) * (inside - a));
  const double slope = a * (at_touch + F * b) / (2 * EI);
  return c + slope * b + F * b * b * b / (3 * EI);
}

TEST_CASE("Pushed across beyond a stiff catheter's mouth a wire turns in its room") {
  constexpr double kRoom_mm = 0.15;
  const double segment_mm = GENERATE(2.0, 1.0, 0.5, 0.25);
  const int points = GENERATE(1, 4);
  const double b = 10;
  const double F = 2e-6;
  Loose loose({Straight(kWire_N_mm2, kWireRadius_mm, segment_mm), Straight(1e3, 0.5, segment_mm)},
              kWireRadius_mm + kRoom_mm, {0, 0, F}, points, 100);
  const int iterations = loose.MoveTo({{60 + b, 0}, {60, 0}});
  const double expected = DeflectionBeyondMouth(kWire_N_mm2, kRoom_mm, 60, b, F);
  const double room_less = F * b * b * b / (3 * kWire_N_mm2);
  CAPTURE(segment_mm, points, iterations, expected, room_less);
  CHECK(loose.state.tip()[2] == Approx(expected).epsilon(0.01));
}

}  // namespace
}  // namespace torquer::test
