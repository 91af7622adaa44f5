// Wires of sections that end anywhere, compared with the differential equation of a planar rod.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kLength_mm = 100;

// A rod along x from its clamp, with a dead force along y at its end.
struct PlanarRod {
  std::vector<WireSection> sections;
  double force_N = 0;
};

double Between(const WireSection& a, const WireSection& b, double from_tip_mm, double at_a,
               double at_b) {
  const double t = (from_tip_mm - a.from_tip_mm) / (b.from_tip_mm - a.from_tip_mm);
  return at_a + t * (at_b - at_a);
}

// Slope of the angle: moment over EI plus the rest curvature, which bends towards +y.
double Bend(const PlanarRod& rod, double arc_mm, double lever_mm) {
  const double from_tip_mm = kLength_mm - arc_mm;
  const auto& sections = rod.sections;
  std::size_t b = 0;
  while (b < sections.size() && sections[b].from_tip_mm < from_tip_mm) ++b;
  double rigidity = 0;
  double curvature = 0;
  if (b == 0 || b == sections.size()) {
    const WireSection& only = b == 0 ? sections.front() : sections.back();
    rigidity = only.rigidity_N_mm2;
    curvature = only.curvature_1_per_mm;
  } else {
    const WireSection& before = sections[b - 1];
    const WireSection& after = sections[b];
    rigidity = Between(before, after, from_tip_mm, before.rigidity_N_mm2, after.rigidity_N_mm2);
    curvature =
        Between(before, after, from_tip_mm, before.curvature_1_per_mm, after.curvature_1_per_mm);
  }
  return rod.force_N * lever_mm / rigidity + curvature;
}

// Angle, x and y at an arc length.
using Values = Eigen::Vector3d;

// Runge-Kutta from the clamp to the end, by pieces that end at the sections. `end_mm`: x of the
// end, to which the force has its lever.
Values Integrate(const PlanarRod& rod, double end_mm) {
  std::vector<double> ends = {kLength_mm};
  for (const WireSection& section : rod.sections) {
    ends.push_back(kLength_mm - section.from_tip_mm);
  }
  std::sort(ends.begin(), ends.end());
  Values at = Values::Zero();
  double from_mm = 0;
  for (const double to_mm : ends) {
    if (to_mm <= from_mm) continue;
    const int steps = 400;
    const double h = (to_mm - from_mm) / steps;
    // Evaluated a little inside the piece, because properties may step at its ends.
    const auto slope = [&](double part, const Values& v) -> Values {
      const double arc_mm = from_mm + std::clamp(part, 1e-9, steps - 1e-9) * h;
      return {Bend(rod, arc_mm, end_mm - v[1]), std::cos(v[0]), std::sin(v[0])};
    };
    for (int k = 0; k < steps; ++k) {
      const Values a = slope(k, at);
      const Values b = slope(k + 0.5, at + h / 2 * a);
      const Values c = slope(k + 0.5, at + h / 2 * b);
      const Values d = slope(k + 1, at + h * c);
      at += h / 6 * (a + 2 * b + 2 * c + d);
    }
    from_mm = to_mm;
  }
  return at;
}

// End of the rod at rest, by bisection of its x.
Vector3d EndAtRest(const PlanarRod& rod) {
  double low_mm = -kLength_mm;
  double high_mm = kLength_mm;
  if (rod.force_N == 0) low_mm = high_mm = 0;
  for (int k = 0; k < 60 && low_mm < high_mm; ++k) {
    const double middle_mm = (low_mm + high_mm) / 2;
    (Integrate(rod, middle_mm)[1] > middle_mm ? low_mm : high_mm) = middle_mm;
  }
  const Values end = Integrate(rod, (low_mm + high_mm) / 2);
  return {end[1], end[2], 0};
}

// End of the simulated wire.
Vector3d EndOfWire(const PlanarRod& rod, double segment_mm) {
  const WireModel model(segment_mm, rod.sections, 0, kLength_mm, BendingLaw::kExact, {});
  // The first normal is the direction of the rest curvature; the force bends the wire the same way.
  const Vector3d towards = model.sheath_normal();
  EndForce force(rod.force_N * towards);
  const FreeSpace field;
  const WallModel wall;
  const std::vector<EnergyTerm*> terms = {&force};
  NewtonRelaxation relaxation(model, field, wall, {.tolerance = 1e-10}, terms);
  WireState state = LayStraight(model, kLength_mm);
  relaxation.Restart(state);
  REQUIRE(Settle(relaxation, {kLength_mm, 0}, state).converged);
  const Vector3d end = state.nodes().back();
  return {end[0], end.dot(towards), 0};
}

// Order of the largest error for four phases of the segments to the sections.
double Order(const PlanarRod& rod) {
  const Vector3d exact = EndAtRest(rod);
  std::vector<double> error_mm;
  for (const int segments : {25, 50, 100, 200, 400}) {
    double largest_mm = 0;
    for (const double part : {0.0, 0.25, 0.5, 0.75}) {
      const Vector3d end = EndOfWire(rod, kLength_mm / (segments + part));
      largest_mm = std::max(largest_mm, (end - exact).norm());
    }
    error_mm.push_back(largest_mm);
  }
  UNSCOPED_INFO("errors " << error_mm[0] << " " << error_mm[1] << " " << error_mm[2] << " "
                          << error_mm[3] << " " << error_mm[4]);
  // Slope of the regression line through five equidistant logarithms.
  const auto log2_of = [&](std::size_t k) { return std::log2(error_mm[k]); };
  return (2 * (log2_of(0) - log2_of(4)) + log2_of(1) - log2_of(3)) / 10;
}

WireSection At(double from_tip_mm, double rigidity_N_mm2, double curvature_per_mm) {
  return {from_tip_mm, rigidity_N_mm2, 0.2, curvature_per_mm, 0, 0};
}

TEST_CASE("Sections that end anywhere keep the second order in the segment") {
  const double jump_mm = 1e-6;
  const PlanarRod taper{{At(28.7, 0.5, 0), At(76.3, 10, 0)}, 2e-4};
  const PlanarRod step{{At(38.197, 0.3, 0), At(38.197 + jump_mm, 5, 0)}, 1e-4};
  const PlanarRod shaped{{At(16.67, 1, 0.1), At(16.67 + jump_mm, 1, 0)}, 0};
  const PlanarRod bowed{{At(3.1, 1, 0.01), At(41.4, 1, 0.05), At(57.9, 1, -0.02)}, 0};
  const PlanarRod both{{At(16.67, 0.3, 0.1), At(16.67 + jump_mm, 5, 0)}, 1e-3};
  const PlanarRod rod = GENERATE_COPY(taper, step, shaped, bowed, both);
  const double order = Order(rod);
  INFO("first section ends at " << rod.sections[0].from_tip_mm << " order " << order);
  CHECK(order > 1.9);
}

}  // namespace
}  // namespace torquer::test
