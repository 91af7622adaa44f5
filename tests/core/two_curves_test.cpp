// Instruments on two to four curves, each with clearance in the lumen of the next one. Quadratic
// model, sweep, feeding and equilibrium.
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

// Instruments on up to four curves: the lumens that have room, and what lies beside others.
struct Room {
  InstrumentPoses poses;
  std::array<bool, kMostInstruments> rooms;
  std::array<bool, kMostInstruments> beside = {};
};

const std::vector<Room>& Rooms() {
  static const std::vector<Room> rooms = {
      {kWireLeads, {false, true}},
      {kCatheterLeads, {false, true}},
      {kThreeWireLeads, {false, true}},
      {kThreeCatheterLeads, {false, true}},
      {kThreeWireLeads, {false, false, true}},
      {kThreeWireLeads, {false, true, true}},
      {kThreeCatheterLeads, {false, true, true}},
      {{{15.1, 0.4}, {10.7, -0.8}, {12.3, 0.5}, {6.2, 0}}, {false, true, false, true}},
      {{{15.1, 0.4}, {10.7, -0.8}, {12.3, 0.5}, {6.2, 0}}, {false, true, true, true}},
      // A second wire beside the first, without and with an instrument around both.
      {kWireLeads, {}, {false, true}},
      {kCatheterLeads, {}, {false, true}},
      {kThreeWireLeads, {false, false, true}, {false, true}},
      {kThreeWireLeads, {false, true}, {false, false, true}},
      {{{15.1, 0.4}, {7.7, -0.8}, {12.3, 0.5}}, {false, true}, {false, false, true}},
      {{{15.1, 0.4}, {10.7, -0.8}, {12.3, 0.5}, {6.2, 0}},
       {false, true, false, true},
       {false, false, true}},
  };
  return rooms;
}

TEST_CASE("Gradient of several curves is that of finite differences") {
  const auto k = GENERATE(range(std::size_t{0}, Rooms().size()));
  const Room& one = Rooms()[k];
  const int points = GENERATE(1, 2, 4);
  if (kUnderSanitizer && points != 1 << (k % 3)) return;
  TwoCurves curves(one.poses, points, 11, GENERATE(0.0, 0.7), one.rooms, one.beside);
  CAPTURE(k, curves.PressedN());
  REQUIRE(curves.at.max_penetration_mm > 0.05);
  REQUIRE(curves.PressedN() > 0);
  CheckGradient(curves);
}

TEST_CASE("The sweep of several curves solves the dense Newton system") {
  const auto k = GENERATE(range(std::size_t{0}, Rooms().size()));
  const Room& one = Rooms()[k];
  const double ratio = GENERATE(0.0, 0.7);
  // Dense Hessians by finite differences take minutes under sanitizers.
  if (kUnderSanitizer && (k > 0 || ratio == 0)) return;
  // Every second layout with instruments beside each other twists.
  if (Rooms()[k].beside != TwoCurves::Marks() && (ratio > 0) != (k % 2 == 0)) return;
  const double weight = ratio > 0 || k > 2 || test::kUnderSanitizer ? 10.0 : GENERATE(0.1, 10.0);
  unsigned seed = 11;
  while (!TwoCurves(one.poses, 2, seed, ratio, one.rooms, one.beside).IsFarFromKinks()) ++seed;
  TwoCurves curves(one.poses, 2, seed, ratio, one.rooms, one.beside);
  CAPTURE(k, ratio, seed);
  CheckStep(curves, weight);
}

// The first segment of the wire points back behind the sheath.
struct Folded : TwoCurves {
  Folded(unsigned seed, double ratio) : TwoCurves(kWireLeads, 2, seed, ratio) {
    Eigen::VectorXd fold = Eigen::VectorXd::Zero(unknowns());
    fold[0] = 2;
    for (int turn = 0; turn < 2; ++turn) state = Stepped(fold);
    Build();
  }
};

TEST_CASE("A wire folded back behind the sheath has its gradient and Newton step") {
  const double ratio = GENERATE(0.0, 0.7);
  if (kUnderSanitizer && ratio == 0) return;
  unsigned seed = 11;
  while (!Folded(seed, ratio).IsFarFromKinks()) ++seed;
  Folded curves(seed, ratio);
  CAPTURE(ratio, seed);
  REQUIRE(curves.state.curve(0).tangents()[0].dot(curves.sheath.direction) < -0.5);
  CheckGradient(curves, 1e-6);
  if (!kUnderSanitizer) CheckStep(curves, 10);
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
              {.has_room = {false, true},
               .lumen_radius_mm = {0, 0.2 + room_mm},
               .stiffness_N_mm2 = 200}),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, none)),
        state(stack.empty_rod(), 2) {
    relaxation->Restart(state);
  }
};

// Each instrument leads for a while, then both are out, and both go in again.
InstrumentPoses Pass(int k) {
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
  // The hash includes the outer curve.
  const Curve& outer = a.state.curve(1);
  CHECK(outer.segments() > 0);
  WireState other = a.state;
  std::vector<Frame> frames;
  for (std::size_t i = 0; i < outer.tangents().size(); ++i) {
    frames.push_back(TangentFrame(outer.tangents()[i], outer.normals()[i]));
  }
  other.curve(1).Step(a.stack.empty_rod(1), outer, frames,
                      std::vector<Vector2d>(frames.size(), Vector2d(1e-12, 0)),
                      std::vector<double>(frames.size(), 0), 1);
  CHECK(HashState(other) != HashState(a.state));
}

TEST_CASE("A copy of two curves continues like the original") {
  const double ratio = GENERATE(0.0, 0.7);
  const int copied = GENERATE(37, 130, 190);  // each instrument leads
  if (kUnderSanitizer && (ratio == 0) != (copied == 130)) return;
  LooseArcs a(ratio);
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
  const InstrumentPoses wire_leads{{30, 0.5}, {22, -1}};
  const InstrumentPoses catheter_leads{{22.4, 0.5}, {31, -1}};
  const double ratio = GENERATE(0.0, 0.7);
  LooseArcs straight(ratio);
  REQUIRE(Settle(*straight.relaxation, wire_leads, straight.state, 400).converged);
  LooseArcs passed(ratio);
  REQUIRE(Settle(*passed.relaxation, catheter_leads, passed.state, 400).converged);
  CHECK(passed.state.FarthestCurve() == 1);
  REQUIRE(Settle(*passed.relaxation, wire_leads, passed.state, 400).converged);
  CHECK(passed.state.FarthestCurve() == 0);
  REQUIRE(passed.state.segments() == straight.state.segments());
  CHECK(LargestDistance(passed.state, straight.state) < 1e-6);
  CHECK(LargestDistance(passed.state.curve(1), straight.state.curve(1)) < 1e-6);
}

TEST_CASE("The error that the solver gives for two curves is that of the next step") {
  LooseArcs arcs(GENERATE(0.0, 0.7));
  REQUIRE(Settle(*arcs.relaxation, {{30, 0.5}, {22, -1}}, arcs.state, 400).converged);
  CHECK(arcs.relaxation->SolverErrorMm(arcs.state) < 1e-5);
  // After a spent budget the reported error is about the true one, on both curves.
  CountedBudget few(3);
  arcs.relaxation->Tick({{30, 0.6}, {22, -1.3}}, few, arcs.state);
  const double said_mm = arcs.relaxation->SolverErrorMm(arcs.state);
  const WireState before = arcs.state;
  REQUIRE(Settle(*arcs.relaxation, arcs.state.poses(), arcs.state, 400).converged);
  const double true_mm = std::max(LargestDistance(before, arcs.state),
                                  LargestDistance(before.curve(1), arcs.state.curve(1)));
  CAPTURE(said_mm, true_mm);
  CHECK(true_mm > 1e-4);
  CHECK(said_mm == Approx(true_mm).epsilon(0.2));
}

TEST_CASE("Instruments with room and rising torsional stiffness approach those without twist") {
  const InstrumentPoses poses{{30, 1.2}, {22, -1}};
  LooseArcs rigid(0);
  REQUIRE(Settle(*rigid.relaxation, poses, rigid.state, 400).converged);
  CheckFallsAsCompliance([&](double ratio) {
    LooseArcs twisting(ratio);
    REQUIRE(Settle(*twisting.relaxation, poses, twisting.state, 400).converged);
    return LargestDistance(twisting.state, rigid.state);
  });
}

TEST_CASE("Instruments that twist approach those on one curve as their room shrinks") {
  const InstrumentPoses poses{{30, 1.2}, {22, -1}};
  FreeStack together({Arc(2, 0.04, 0.2, 1.4), Arc(3, -0.01, 0.6, 2.1)});
  together.MoveTo(poses);
  double before_mm = 0;
  for (const double room_mm : {0.16, 0.04, 0.01}) {
    LooseArcs loose(0.7, room_mm);
    REQUIRE(Settle(*loose.relaxation, poses, loose.state, 400).converged);
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
  const Clearance good{
      .has_room = {false, true}, .lumen_radius_mm = {0, 0.35}, .stiffness_N_mm2 = 1};
  CHECK_NOTHROW(make(good));
  Clearance bad = good;
  bad.lumen_radius_mm[1] = 0.2;
  CHECK_THROWS_WITH(make(bad), Catch::Contains("0.2"));
  bad = good;
  bad.stiffness_N_mm2 = 0;
  CHECK_THROWS_AS(make(bad), std::invalid_argument);
  bad = good;
  bad.has_room = {false, false, true};
  CHECK_THROWS_AS(make(bad), std::invalid_argument);
}

}  // namespace
}  // namespace torquer::test
