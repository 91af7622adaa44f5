// Instruments on two curves, the inner ones with clearance in the lumen of the outer ones:
// expansion, sweep, feeding and equilibrium.
#include "tests/support/two_curves.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "host/simulator/core/newton/front_sweep.h"
#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/finite_differences.h"
#include "tests/support/free_stack.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

TEST_CASE("Gradient of two curves is that of finite differences") {
  const InstrumentPlaces places =
      GENERATE(kWireLeads, kCatheterLeads, kThreeWireLeads, kThreeCatheterLeads);
  TwoCurves curves(places, GENERATE(1, 2, 4), 11, GENERATE(0.0, 0.7));
  CAPTURE(curves.at.between.pressed_N, curves.at.between.end_pressed_N);
  REQUIRE(curves.at.max_penetration_mm > 0.05);
  REQUIRE(curves.at.between.pressed_N > 0);
  const Eigen::VectorXd gradient =
      GradientOf([&](const Eigen::VectorXd& x) { return curves.Energy(x); },
                 Eigen::VectorXd::Zero(curves.unknowns()), 1e-4);
  CHECK((gradient - curves.Gradient()).norm() < 1e-7 * gradient.norm());
}

TEST_CASE("The sweep of two curves solves the dense Newton system") {
  const InstrumentPlaces places =
      GENERATE(kWireLeads, kCatheterLeads, kThreeWireLeads, kThreeCatheterLeads);
  const double ratio = GENERATE(0.0, 0.7);
  if (kUnderSanitizer && (ratio > 0) == (places.size() == 3)) return;
  const double weight = ratio > 0 || test::kUnderSanitizer ? 10.0 : GENERATE(0.1, 10.0);
  // No spring is so close to contact that the finite differences cross its kink.
  TwoCurves curves(places, 2, 11, ratio);
  for (const BetweenCurves::Spring& spring : curves.at.between.springs) {
    REQUIRE(std::abs(spring.penetration_mm) > 1e-3);
  }
  CAPTURE(weight, ratio);
  REQUIRE(curves.at.between.pressed_N > 0);
  Eigen::MatrixXd hessian = HessianOf([&](const Eigen::VectorXd& x) { return curves.Energy(x); },
                                      Eigen::VectorXd::Zero(curves.unknowns()), 2e-4);
  Eigen::VectorXd unit(curves.unknowns());
  unit << UnitWeight(curves.model, curves.state), UnitWeight(curves.second, *curves.state.second());
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      hessian, Eigen::MatrixXd(unit.asDiagonal()));
  const double lift = -eigen.eigenvalues()[0];
  FrontSweep sweep(curves.model.max_segments(), curves.stack.second_rod());
  CHECK_FALSE(sweep.Factor(curves.model, curves.state, curves.at, lift - 1e-3));
  CHECK(sweep.Factor(curves.model, curves.state, curves.at, lift + 1e-3));

  hessian.diagonal() += (lift + weight) * unit;
  const Eigen::VectorXd dense = -hessian.llt().solve(curves.Gradient());
  REQUIRE(sweep.Factor(curves.model, curves.state, curves.at, lift + weight));
  std::vector<Vector2d> step;
  std::vector<double> spin;
  std::vector<Vector3d> displacement;
  const double predicted =
      sweep.Step(curves.model, curves.state, curves.at, step, spin, displacement);
  Eigen::VectorXd swept(curves.unknowns());
  swept << Unknowns(curves.model, step, spin),
      Unknowns(curves.second, sweep.second_step(), sweep.second_spin());
  CHECK((swept - dense).norm() < 1e-5 * dense.norm());
  CHECK(predicted == Approx(-curves.Gradient().dot(dense) / 2).epsilon(1e-5));
  // A sweep resumed from the middle gives a bit-identical result.
  const std::vector<Vector2d> second = sweep.second_step();
  REQUIRE(sweep.Refactor(curves.model, curves.state, curves.at, lift + weight, 2));
  std::vector<Vector2d> again;
  sweep.Step(curves.model, curves.state, curves.at, again, spin, displacement);
  CHECK(again == step);
  CHECK(sweep.second_step() == second);
}

// A bent wire in a bent catheter, in free space. `ratio` is GJ over EI; 0 means that neither
// twists.
struct LooseArcs {
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall;
  std::vector<EnergyTerm*> none;
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  explicit LooseArcs(double ratio, double room_mm = 0.15)
      : stack({Arc(2, 0.04, 0.2, 2 * ratio), Arc(3, -0.01, 0.6, 3 * ratio)},
              {.first_outer = 1, .lumen_radius_mm = {0, 0.2 + room_mm}, .stiffness_N_mm2 = 200}),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, none)),
        state(stack.rod(), 2) {
    relaxation->Restart(state);
  }
};

// Each instrument leads for a while, then both are out, and both go in again.
InstrumentPlaces Pass(int k) {
  if (k < 100) return {{0.3 * k, 0.02 * k}, {0.2 * k, -0.01 * k}};
  if (k < 160) return {{30 - 0.1 * (k - 100), 2}, {20 + 0.3 * (k - 100), -1}};
  if (k < 180) return {{0, 0}, {0, 0}};
  return {{0.2 * (k - 180), 0}, {0.25 * (k - 180), 0}};
}

TEST_CASE("Any budget leaves both curves whole and no heap, and the same work the same bits") {
  const double ratio = GENERATE(0.0, 0.7);
  LooseArcs a(ratio);
  LooseArcs b(ratio);
  constexpr int kTicks = 220;
  std::vector<int> work;
  work.reserve(kTicks);
  const std::size_t allocated = AllocationCount();
  for (int k = 1; k <= kTicks; ++k) {
    CountedBudget budget(k % 7);
    work.push_back(a.relaxation->Tick(Pass(k), budget, a.state).work);
  }
  CHECK(AllocationCount() == allocated);
  for (int k = 1; k <= kTicks; ++k) {
    CountedBudget budget(work[static_cast<std::size_t>(k) - 1]);
    b.relaxation->Tick(Pass(k), budget, b.state);
  }
  CHECK(HashState(a.state) == HashState(b.state));
  CHECK(a.relaxation->Hash(0) == b.relaxation->Hash(0));
  // The hash includes the second curve.
  CHECK(a.state.second()->segments() > 0);
  WireState other = a.state;
  std::vector<Frame> frames;
  for (std::size_t i = 0; i < a.state.second()->tangents().size(); ++i) {
    frames.push_back(TangentFrame(a.state.second()->tangents()[i], a.state.second()->normals()[i]));
  }
  other.StepSecond(*a.stack.second_rod(), a.state, frames,
                   std::vector<Vector2d>(frames.size(), Vector2d(1e-12, 0)),
                   std::vector<double>(frames.size(), 0), 1);
  CHECK(HashState(other) != HashState(a.state));
}

TEST_CASE("A copy of two curves goes on as the original") {
  const double ratio = GENERATE(0.0, 0.7);
  LooseArcs a(ratio);
  const int copied = GENERATE(37, 130, 190);  // each instrument leads
  for (int k = 1; k <= copied; ++k) {
    CountedBudget budget(5);
    a.relaxation->Tick(Pass(k), budget, a.state);
  }
  LooseArcs b(ratio);
  b.state = a.state;
  b.relaxation->CopyFrom(*a.relaxation, b.state);
  for (int k = copied + 1; k <= 220; ++k) {
    CountedBudget budgets[2] = {CountedBudget(5), CountedBudget(5)};
    a.relaxation->Tick(Pass(k), budgets[0], a.state);
    b.relaxation->Tick(Pass(k), budgets[1], b.state);
    REQUIRE(HashState(a.state) == HashState(b.state));
  }
}

TEST_CASE("Instruments that pass each other in free space lie as if they had not") {
  const InstrumentPlaces wire_leads{{30, 0.5}, {22, -1}};
  const InstrumentPlaces catheter_leads{{22.4, 0.5}, {31, -1}};
  const double ratio = GENERATE(0.0, 0.7);
  LooseArcs straight(ratio);
  REQUIRE(Settle(*straight.relaxation, wire_leads, straight.state, 400).converged);
  LooseArcs passed(ratio);
  REQUIRE(Settle(*passed.relaxation, catheter_leads, passed.state, 400).converged);
  CHECK(passed.state.outer_leads());
  REQUIRE(Settle(*passed.relaxation, wire_leads, passed.state, 400).converged);
  CHECK_FALSE(passed.state.outer_leads());
  REQUIRE(passed.state.segments() == straight.state.segments());
  CHECK(LargestDistance(passed.state, straight.state) < 1e-6);
  CHECK(LargestDistance(*passed.state.second(), *straight.state.second()) < 1e-6);
}

TEST_CASE("The error that the solver gives for two curves is that of the next step") {
  LooseArcs arcs(GENERATE(0.0, 0.7));
  REQUIRE(Settle(*arcs.relaxation, {{30, 0.5}, {22, -1}}, arcs.state, 400).converged);
  CHECK(arcs.relaxation->SolverErrorMm(arcs.state) < 1e-5);
  // After a spent budget the reported error is about the true one, on both curves.
  CountedBudget few(4);
  arcs.relaxation->Tick({{30, 0.6}, {22, -1.3}}, few, arcs.state);
  const double said_mm = arcs.relaxation->SolverErrorMm(arcs.state);
  const WireState before = arcs.state;
  REQUIRE(Settle(*arcs.relaxation, arcs.state.places(), arcs.state, 400).converged);
  const double true_mm = std::max(LargestDistance(before, arcs.state),
                                  LargestDistance(*before.second(), *arcs.state.second()));
  CAPTURE(said_mm, true_mm);
  CHECK(true_mm > 1e-4);
  CHECK(said_mm == Approx(true_mm).epsilon(0.2));
}

TEST_CASE("Ever stiffer against twist, instruments with room come to those that do not twist") {
  const InstrumentPlaces places{{30, 1.2}, {22, -1}};
  LooseArcs rigid(0);
  REQUIRE(Settle(*rigid.relaxation, places, rigid.state, 400).converged);
  CheckFallsAsCompliance([&](double ratio) {
    LooseArcs twisting(ratio);
    REQUIRE(Settle(*twisting.relaxation, places, twisting.state, 400).converged);
    return LargestDistance(twisting.state, rigid.state);
  });
}

TEST_CASE("With ever less room, instruments that twist come to those on one curve") {
  const InstrumentPlaces places{{30, 1.2}, {22, -1}};
  FreeStack together({Arc(2, 0.04, 0.2, 1.4), Arc(3, -0.01, 0.6, 2.1)});
  together.MoveTo(places);
  double before_mm = 0;
  for (const double room_mm : {0.16, 0.04, 0.01}) {
    LooseArcs loose(0.7, room_mm);
    REQUIRE(Settle(*loose.relaxation, places, loose.state, 400).converged);
    const double apart_mm = LargestDistance(loose.state, together.state);
    CAPTURE(room_mm, apart_mm, before_mm);
    if (before_mm > 0) CHECK(apart_mm < 0.7 * before_mm);
    before_mm = apart_mm;
  }
  CHECK(before_mm < 0.3);
}

TEST_CASE("Room that cannot be is refused") {
  const auto make = [](const Clearance& clearance) {
    return InstrumentStack({Arc(2, 0, 0.2), Arc(3, 0, 0.6)}, clearance);
  };
  const Clearance good{.first_outer = 1, .lumen_radius_mm = {0, 0.35}, .stiffness_N_mm2 = 1};
  CHECK_NOTHROW(make(good));
  Clearance bad = good;
  bad.lumen_radius_mm[1] = 0.2;
  CHECK_THROWS_WITH(make(bad), Catch::Contains("0.2"));
  bad = good;
  bad.stiffness_N_mm2 = 0;
  CHECK_THROWS_AS(make(bad), std::invalid_argument);
  bad = good;
  bad.first_outer = 2;
  CHECK_THROWS_AS(make(bad), std::invalid_argument);
}

}  // namespace
}  // namespace torquer::test
