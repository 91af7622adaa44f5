// Wires of sections that end anywhere, compared with the differential equation of a planar rod.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
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

// An instrument of a stack. It bends towards its first normal. Its hand has turned it by a half
// turn or not at all.
struct Member {
  std::vector<WireSection> sections;
  double insertion_mm = kLength_mm;
  bool turned = false;
};

// End of the simulated instruments, the innermost first.
Vector3d EndOfStack(const std::vector<Member>& members, double force_N, double segment_mm) {
  std::vector<WireModel> models;
  InstrumentPoses poses(static_cast<int>(members.size()));
  for (std::size_t k = 0; k < members.size(); ++k) {
    models.emplace_back(segment_mm, members[k].sections, 0, kLength_mm, BendingLaw::kExact,
                        Sheath());
    poses[static_cast<int>(k)] = {members[k].insertion_mm,
                                  members[k].turned ? std::numbers::pi : 0};
  }
  InstrumentStack stack(std::move(models));
  // The first normal is the direction of the rest curvature; the force bends the wire the same way.
  const Vector3d towards = stack.empty_rod().sheath_normal();
  EndForce force(force_N * towards);
  const std::vector<EnergyTerm*> terms = {&force};
  const FreeSpace field;
  const WallModel wall;
  const auto relaxation = MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-10}, terms);
  WireState state = WireState::Along(stack.empty_rod(), {}, poses);
  relaxation->Restart(state);
  REQUIRE(Settle(*relaxation, poses, state).converged);
  const Vector3d end = state.nodes().back();
  return {end[0], end.dot(towards), 0};
}

// Order of the largest error for four phases of the segments to the sections. `rod` is the rod that
// the members make together.
double Order(const PlanarRod& rod, const std::vector<Member>& members) {
  const Vector3d exact = EndAtRest(rod);
  std::vector<double> error_mm;
  for (const int segments : {25, 50, 100, 200, 400}) {
    double largest_mm = 0;
    for (const double part : {0.0, 0.25, 0.5, 0.75}) {
      const Vector3d end = EndOfStack(members, rod.force_N, kLength_mm / (segments + part));
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
  const double order = Order(rod, {{rod.sections}});
  INFO("first section ends at " << rod.sections[0].from_tip_mm << " order " << order);
  CHECK(order > 1.9);
}

// Makes a step before each section but the first: values are constant in between.
std::vector<WireSection> Steps(const std::vector<WireSection>& constant) {
  std::vector<WireSection> sections = {constant.front()};
  for (std::size_t k = 1; k < constant.size(); ++k) {
    sections.push_back(constant[k - 1]);
    sections.back().from_tip_mm = constant[k].from_tip_mm;
    sections.push_back(constant[k]);
    sections.back().from_tip_mm += 1e-6;
  }
  return sections;
}

TEST_CASE("Tips and sections of instruments in each other may lie anywhere") {
  const Member wire{Steps({At(0, 1, 0.06), At(21.3, 2, 0), At(70.7, 4, 0)})};
  const Member catheter{Steps({At(0, 1.5, 0.02), At(13.9, 6, 0)}), 61.73, GENERATE(false, true)};
  const double way = catheter.turned ? -1 : 1;
  // By hand: rigidities add up, and moments balance. The catheter's tip is 38.27 mm from the end.
  const double tip_mm = kLength_mm - catheter.insertion_mm;
  const PlanarRod rod{
      Steps({At(0, 1, 0.06), At(21.3, 2, 0), At(tip_mm, 2 + 1.5, way * 0.02 * 1.5 / 3.5),
             At(tip_mm + 13.9, 2 + 6, 0), At(70.7, 4 + 6, 0)}),
      4e-4};
  const double order = Order(rod, {wire, catheter});
  INFO("catheter " << (catheter.turned ? "turned" : "not turned") << " order " << order);
  CHECK(order > 1.9);
}

}  // namespace
}  // namespace torquer::test
