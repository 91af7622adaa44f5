// Known limits of the paper's method: cases in which it must fail or may divide by zero.
#include <catch2/catch.hpp>
#include <limits>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/invariants.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

TEST_CASE("Denominators at and around zero leave every update rule's step bounded") {
  // One straight segment head-on against a plane: u.B = k penetration (as a force), and rho is the
  // clamp's. The stiffness is chosen such that rho - u.B has the wanted value.
  const WireParameters parameters{.segment_mm = 1, .max_length_mm = 3};
  const WireModel model = MakeWire(parameters);
  const HalfSpace wall_ahead(Vector3d(1, 0, 0), -Vector3d::UnitX());
  const double penetration = parameters.radius_mm;
  const double rho = parameters.rigidity_N_mm2 / 0.5;  // half a segment at the clamp, lambda = 1
  for (const double off : {0.0, 1e-300, 1e-15, -1e-15, 1e-6, -1e-6, 0.5, -0.5}) {
    const WallModel wall{.stiffness_N_mm2 = rho * (1 - off) / penetration, .points_per_segment = 1};
    for (const UpdateRule rule : {UpdateRule::kSigned, UpdateRule::kRhoOnly, UpdateRule::kAbsolute,
                                  UpdateRule::kExactRoot}) {
      for (const double tilt : {0.0, 1e-300, 1e-12, 1e-3}) {
        for (const double max_update : {0.1, std::numeric_limits<double>::infinity()}) {
          PhysicalSettings settings;
          settings.rule = rule;
          settings.max_update = max_update;
          PhysicalRelaxation physical(model, wall_ahead, wall, settings);
          WireState state = WithTangent(model, LayStraight(model, 1), 0, Vector3d(1, tilt, 0));
          physical.Restart(state);
          for (int k = 0; k < 20; ++k) {
            const double step = physical.Update(0, state);
            INFO("rule " << static_cast<int>(rule) << " off " << off << " tilt " << tilt << " max "
                         << max_update << " update " << k << " step " << step);
            REQUIRE_THAT(BrokenGeometry(model, state), Catch::Equals(""));
            REQUIRE(step <= std::min(max_update, 2.0) + 1e-12);
          }
        }
      }
    }
  }
}

TEST_CASE("Segments folded back onto each other do not stop Newton; the paper's updates stay") {
  const WireModel model = MakeWire({.max_length_mm = 30});
  const FreeSpace field;
  const WallModel wall{.points_per_segment = 1};
  std::vector<Vector3d> tangents(20, Vector3d::UnitX());
  for (std::size_t i = 1; i < 20; i += 2) tangents[i] = -Vector3d::UnitX();
  const WireState folded = WithTangents(model, LayStraight(model, 20), tangents);
  REQUIRE_THAT(BrokenGeometry(model, folded), Catch::Equals(""));

  WireState state = folded;
  const std::vector<EnergyTerm*> none;
  NewtonRelaxation newton(model, field, wall, {}, none);
  newton.Restart(state);
  CHECK(Settle(newton, {20, 0}, state).converged);
  CHECK((state.nodes().back() - Vector3d(20, 0, 0)).norm() < 1e-3);

  // An exact fold has no torque, so the paper's updates do nothing.
  state = folded;
  PaperRelaxation paper(model, field, wall, {});
  paper.Restart(state);
  for (int k = 0; k < 20; ++k) {
    CountedBudget budget(100);
    paper.Tick({20, 0}, budget, state);
    REQUIRE_THAT(BrokenGeometry(model, state), Catch::Equals(""));
  }
  CHECK((state.nodes().back() - folded.nodes().back()).norm() < 1e-9);
}

TEST_CASE("Fed exactly head-on into a blind end Newton's wire buckles, the paper's perforates") {
  const Capsule field(Vector3d(-10, 0, 0), Vector3d(40, 0, 0), 3);
  const WireModel model = MakeWire({.max_length_mm = 130});
  const auto deepest = [&](Relaxation& relaxation) {
    WireState state(model);
    relaxation.Restart(state);
    double worst = 0;
    for (int k = 1; k <= 120; ++k) {
      CountedBudget budget(400);
      worst = std::max(worst, relaxation.Tick({1.0 * k, 0}, budget, state).max_penetration_mm);
    }
    return worst;
  };
  const WallModel wall{.stiffness_N_mm2 = 0.05, .points_per_segment = 1};
  const std::vector<EnergyTerm*> none;
  NewtonRelaxation newton(model, field, wall, {}, none);
  CHECK(deepest(newton) < 0.1);
  // Without a force across the wire, (16) to (19) give no update, even at an unstable equilibrium.
  PaperRelaxation paper(model, field, wall, {});
  CHECK(deepest(paper) > 70);
}

TEST_CASE("A very stiff wire leaves the lumen by either method, and the report has the depth") {
  const Torus field(Side::kInside, 30, 3);
  const WireModel model = MakeWire({.rigidity_N_mm2 = 6.35e3,
                                    .max_length_mm = 70,
                                    .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}});
  const WallModel wall{.stiffness_N_mm2 = 0.01, .points_per_segment = 1};
  const std::vector<EnergyTerm*> none;
  NewtonRelaxation newton(model, field, wall, {}, none);
  PaperRelaxation paper(model, field, wall, {});
  for (Relaxation* relaxation :
       {static_cast<Relaxation*>(&newton), static_cast<Relaxation*>(&paper)}) {
    WireState state(model);
    relaxation->Restart(state);
    TickChecker checker(model, field, state);
    TickReport report;
    for (int k = 1; k <= 60; ++k) {
      CountedBudget budget(400);
      report = relaxation->Tick({1.0 * k, 0}, budget, state);
      REQUIRE_THAT(checker.Check({1.0 * k, 0}, report, state, 1), Catch::Equals(""));
    }
    CHECK(report.max_penetration_mm > 10);
  }
}

}  // namespace
}  // namespace torquer::test
