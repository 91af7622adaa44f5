// Step of an iteration, compared with the minimum of the one-sided model found by trying all sets
// of springs.
#include "host/simulator/core/newton/step_solver.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>
#include <vector>

#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kLumenRadius_mm = 30;

// Wire that lies along the bottom of a wide cylinder, with every point near the wall.
struct NearWire {
  WireModel model;
  Cylinder field{Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), kLumenRadius_mm};
  WallModel wall{.stiffness_N_mm2 = 0.5, .points_per_segment = 1};
  std::vector<EnergyTerm*> terms;
  WireMechanics mechanics{model, field, wall, terms};
  WireState state{model};
  QuadraticModel at = mechanics.MakeQuadraticModel();

  NearWire(int segments, std::mt19937& random) : model(MakeOnBottom()) {
    state = LayStraight(model, segments);
    Shake(model, 0.008, random, state);
    state.UpdateFrames(model);
    mechanics.BuildModel(state, at);
  }

  static WireModel MakeOnBottom() {
    WireParameters parameters{.segment_mm = 1, .rigidity_N_mm2 = 0.02};
    const Vector3d bottom(0, parameters.radius_mm - kLumenRadius_mm, 0);
    parameters.sheath = {bottom, Vector3d::UnitX()};
    return MakeWire(parameters);
  }
};

// Penetrations of all springs after a step of the model.
std::vector<double> Penetrations(const NearWire& wire, const CurveStep& step) {
  std::vector<double> penetrations_mm;
  for (std::size_t k = 0; k < wire.at.springs.size(); ++k) {
    const int q = wire.at.points.near[k];
    Vector3d moved_mm = Vector3d::Zero();
    for (int i = 0; i <= q; ++i) {
      moved_mm +=
          wire.state.SegmentLength(wire.model, i) *
          (wire.at.frames[static_cast<std::size_t>(i)] * step.xi[static_cast<std::size_t>(i)]);
    }
    penetrations_mm.push_back(
        wire.at.springs[k].penetration_mm -
        wire.at.points.clearance[static_cast<std::size_t>(q)].gradient.dot(moved_mm));
  }
  return penetrations_mm;
}

// Minimum of the one-sided model: the step of the one set whose springs are those that penetrate.
CurveStep FindMinimum(NearWire& wire, double weight) {
  RiccatiSweep<BendStage> sweep(wire.model.max_segments());
  const std::size_t count = wire.at.springs.size();
  CurveStep found;
  int consistent = 0;
  for (unsigned set = 0; set < 1U << count; ++set) {
    std::vector<std::uint8_t> active(count);
    for (std::size_t k = 0; k < count; ++k) active[k] = set >> k & 1;
    wire.mechanics.SumActiveLoads(wire.state, active, wire.at);
    if (!sweep.Factor(wire.model, wire.state, wire.at, weight)) continue;
    CurveStep step;
    sweep.Step(wire.model, wire.state, wire.at, step.xi, step.spin, step.displacement_mm);
    const std::vector<double> penetrations_mm = Penetrations(wire, step);
    bool right = true;
    for (std::size_t k = 0; k < count; ++k) right &= (penetrations_mm[k] > 0) == (active[k] != 0);
    if (!right) continue;
    found = step;
    ++consistent;
  }
  CHECK(consistent == 1);
  return found;
}

TEST_CASE("A step goes to the minimum of the model with one-sided springs") {
  std::mt19937 random(11);
  int minima = 0;
  int several_rounds = 0;
  constexpr int kCases = 60;
  for (int k = 0; k < kCases; ++k) {
    NearWire wire(8, random);
    REQUIRE(wire.at.springs.size() == 8);
    const double weight = k % 2 == 0 ? 0.05 : 0.5;
    StepSolver<RiccatiSweep<BendStage>> solver(wire.mechanics);
    std::vector<ActiveSet> sets{ActiveSet(wire.mechanics.points().capacity())};
    const auto solution = solver.Solve(wire.state, weight, false, sets, wire.at);
    INFO("case " << k << ", " << solution.rounds << " rounds");
    CHECK(solution.expected_mJ > 0);
    const bool is_minimum = solution.definite && solution.rounds < 6;
    minima += is_minimum;
    several_rounds += solution.rounds > 2;
    WireState there(wire.model);
    solver.Apply(wire.state, wire.at, 1e-3, there);
    const CurveStep minimum = FindMinimum(wire, weight);
    if (!is_minimum) continue;
    WireState expected(wire.model);
    expected.Step(wire.model, wire.state, wire.at.frames, minimum.xi, minimum.spin, 1e-3);
    for (std::size_t i = 0; i < there.tangents().size(); ++i) {
      CHECK((there.tangents()[i] - expected.tangents()[i]).norm() < 1e-12);
    }
  }
  CHECK(minima > 0.9 * kCases);
  CHECK(several_rounds > kCases / 4);
}

TEST_CASE("After a move, springs press as they did before it, and act where they did") {
  std::mt19937 random(13);
  NearWire wire(8, random);
  for (std::size_t k = 0; k < wire.at.springs.size(); ++k) {
    wire.at.springs[k].penetration_mm = k % 2 == 0 ? 0.02 : -0.01;
  }
  ActiveSet set(wire.mechanics.points().capacity());
  set.RememberPressed(wire.at);
  std::vector<double> before_N;
  for (const WallSpring& spring : wire.at.springs) before_N.push_back(spring.ContactForceN());
  // The corners that a feed cuts.
  for (WallSpring& spring : wire.at.springs) spring.penetration_mm += 0.03;
  set.Begin(true, wire.at);
  for (std::size_t k = 0; k < before_N.size(); ++k) {
    CHECK(wire.at.springs[k].force_N == before_N[k]);
    CHECK(set.active()[k] == (k % 2 == 0));
  }
  set.Begin(false, wire.at);
  for (std::size_t k = 0; k < before_N.size(); ++k) {
    const WallSpring& spring = wire.at.springs[k];
    CHECK(spring.force_N == std::max(0.0, spring.stiffness_N_mm * spring.penetration_mm));
    CHECK(set.active()[k] == (spring.penetration_mm > 0));
  }
}

TEST_CASE("A step that stops early still reduces the energy as predicted") {
  std::mt19937 random(12);
  for (int k = 0; k < 40; ++k) {
    NearWire wire(12, random);
    StepSolver<RiccatiSweep<BendStage>> solver(wire.mechanics);
    std::vector<ActiveSet> sets{ActiveSet(wire.mechanics.points().capacity())};
    const auto solution = solver.Solve(wire.state, 0.02, false, sets, wire.at);
    REQUIRE(solution.expected_mJ > 0);
    // Along the step the model is convex, so a small fraction gains more than its share.
    constexpr double kFraction = 1e-3;
    WireState trial(wire.model);
    solver.Apply(wire.state, wire.at, kFraction, trial);
    QuadraticModel there = wire.mechanics.MakeQuadraticModel();
    wire.mechanics.BuildModel(trial, there);
    CHECK(wire.at.energy_mJ - there.energy_mJ > kFraction * solution.expected_mJ);
  }
}

}  // namespace
}  // namespace torquer::test
