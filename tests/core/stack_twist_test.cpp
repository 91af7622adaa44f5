// Nested instruments that twist independently: quadratic model, sweep, frames, and their
// equilibria.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <numbers>

#include "host/simulator/core/newton/front_sweep.h"
#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/dense_newton.h"
#include "tests/support/finite_differences.h"
#include "tests/support/free_stack.h"
#include "tests/support/sanitizer.h"
#include "tests/support/twisted_stack.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kPi = std::numbers::pi;

TEST_CASE("Gradient of a stack that twists is that of finite differences") {
  TwistedStack stack(GENERATE(2, 3, 4), 3);
  CAPTURE(stack.each);
  REQUIRE(stack.at.max_penetration_mm > 0.05);
  const Eigen::VectorXd gradient =
      GradientOf([&](const Eigen::VectorXd& x) { return stack.Energy(x); },
                 Eigen::VectorXd::Zero(stack.unknowns()), 1e-4);
  CHECK((gradient - DenseGradient(stack.model, stack.state, stack.at)).norm() <
        1e-7 * gradient.norm());
}

// An instrument that bends one way, and from a joint on the other way.
WireModel DoubleCurve(double rigidity, double curvature, double at_mm) {
  return WireModel(1,
                   {{0, rigidity, 0.2, curvature, 0, 0.5},
                    {at_mm, rigidity, 0.2, curvature, 0, 0.5},
                    {at_mm + 1e-6, rigidity, 0.2, -curvature, 0, 0.5}},
                   0, 60, BendingLaw::kExact, {});
}

TEST_CASE("Instruments bend each other at a joint whose own rest angles cancel") {
  // Half a hat bends one way, half the other way: the rest angle of joint 4 is 0.
  const double catheter_curvature = GENERATE(0.05, 0.0);
  FreeStack both({DoubleCurve(1, 0.1, 4), DoubleCurve(2, catheter_curvature, 4)});
  const InstrumentPoses poses{{8, 0.3}, {8, 1.7}};
  CombinedRods rods(both.stack);
  rods.Combine(poses);
  const WireModel& model = rods[0];
  REQUIRE(model.twisting_joint(4).of[0].bend_rad.norm() < 1e-6);
  const FreeSpace field;
  const WallModel wall;
  const std::vector<EnergyTerm*> none;
  WireMechanics mechanics(model, field, wall, none);
  const WireState state = WireState::Along(model, {}, poses);
  QuadraticModel at = mechanics.MakeQuadraticModel();
  mechanics.BuildModel(state, at);
  const auto energy = [&](const Eigen::VectorXd& x) {
    QuadraticModel there = mechanics.MakeQuadraticModel();
    mechanics.BuildGradient(StackStep(model, state, x), there);
    return there.energy_mJ;
  };
  const Eigen::VectorXd gradient =
      GradientOf(energy, Eigen::VectorXd::Zero(4 * state.segments()), 1e-3);
  CHECK((gradient - DenseGradient(model, state, at)).norm() < 1e-7 * gradient.norm());
  // A straight rod: each instrument bends back by its own curvature, everywhere. But the segments
  // beside joint 4 may bend to and fro, as the rod rests.
  const double own_mJ_mm = (1 * 0.1 * 0.1 + 2 * catheter_curvature * catheter_curvature) / 2;
  const double rest_mJ_mm = (0.1 * 0.1 + std::pow(2 * catheter_curvature, 2) +
                             2 * 0.1 * 2 * catheter_curvature * std::cos(1.4)) /
                            (2 * 3);
  CHECK(at.energy_mJ == Approx(own_mJ_mm * 7.5 - rest_mJ_mm).epsilon(1e-3));
}

TEST_CASE("The sweep of a stack that twists solves the dense Newton system") {
  const double weight = test::kUnderSanitizer ? 10.0 : GENERATE(0.1, 10.0);
  const int count = GENERATE(2, 3, 4);
  if (kUnderSanitizer && count > 2) return;
  TwistedStack stack(count, 5);
  CAPTURE(stack.each, weight);
  const Eigen::MatrixXd hessian =
      HessianOf([&](const Eigen::VectorXd& x) { return stack.Energy(x); },
                Eigen::VectorXd::Zero(stack.unknowns()), 3e-3);
  const Eigen::VectorXd unit = UnitWeight(stack.model, stack.state);
  FrontSweep sweep({&stack.model}, {});
  CheckSweepIsDense(sweep, stack.model, stack.state, stack.at, hessian, unit, weight);
}

// An arc that twists; with a ratio of 0 it does not.
WireModel TwistingArc(double rigidity, double curvature, double ratio,
                      double segment_mm = kArcSegmentMm) {
  return Arc(rigidity, curvature, 0.2, ratio * rigidity, segment_mm);
}

TEST_CASE("A stack with rising torsional stiffness approaches one without twist") {
  const InstrumentPoses poses{{60, 0.3}, {35, 1.5}, {20, -1}};
  const auto make = [](double ratio) {
    return std::vector<WireModel>{TwistingArc(2, 0.03, ratio), TwistingArc(3, 0.01, ratio),
                                  TwistingArc(5, -0.02, ratio)};
  };
  FreeStack rigid(make(0));
  rigid.MoveTo(poses);
  CheckFallsAsCompliance([&](double ratio) {
    FreeStack twisting(make(ratio));
    twisting.MoveTo(poses);
    return LargestDistance(twisting.state, rigid.state);
  });
}

TEST_CASE("Beside a straight one, a wire twists as alone") {
  const double ratio = 0.2;
  const auto bent = [&] { return Bent(2, ratio, 12, 0.05, 0, 0.2, {}, 0.5); };
  // Nearly no stiffness, and straight.
  FreeStack both({bent(), TwistingArc(1e-9, 0, 1)});
  both.MoveTo({{40, 2.5}, {30, -1}});
  const WireModel alone = bent();
  const FreeSpace field;
  const WallModel wall;
  const std::vector<EnergyTerm*> none;
  const auto relaxation = MakeNewtonRelaxation(alone, field, wall, {.tolerance = 1e-9}, none);
  WireState state(alone);
  relaxation->Restart(state);
  REQUIRE(Settle(*relaxation, {40, 2.5}, state).converged);
  CHECK(LargestDistance(both.state, state) < 1e-5);
}

// Two identical nested arcs, whose hands are turned against each other by an angle. With a the
// angle between the arcs, EI k^2 sin(a) / 2 per length turns each back, so that
//
//   a'' = 2 (EI / GJ) k^2 / 2 sin(a) = c^2 sin(a),  a(0) = angle of the hands,  a'(L) = 0.
//
// This is a pendulum, integrated here independently. The opposite position (a = pi) is stable while
// c L < pi/2 (Dupont et al. 2010, concentric tubes). The curve's shape does not matter: both arcs
// twist against the same frames.
double FreeEnd(double hands, double c, double length) {
  // Shooting method from the free end, where a' = 0.
  const auto at_hands = [&](double end) {
    double a = end;
    double rate = 0;
    const int steps = 20000;
    const double h = length / steps;
    for (int k = 0; k < steps; ++k) {  // to the hands; midpoint rule
      const double mid = a + h / 2 * rate;
      const double mid_rate = rate + h / 2 * c * c * std::sin(a);
      a += h * mid_rate;
      rate += h * c * c * std::sin(mid);
    }
    return a;
  };
  double low = 0;
  double high = hands;
  for (int k = 0; k < 60; ++k) {
    const double mid = (low + high) / 2;
    (at_hands(mid) < hands ? low : high) = mid;
  }
  return low;
}

double Between(const FreeStack& both) {
  const PerInstrument& turns = both.state.turns_rad().back();
  return turns[1] - turns[0];
}

TEST_CASE("Two arcs turned against each other twist as the pendulum equation has it") {
  constexpr double kCurvature = 0.02;
  constexpr double kRatio = 0.5;
  constexpr double kLength = 40;
  const double c = kCurvature / std::sqrt(kRatio);
  REQUIRE(c * kLength < kPi / 2);
  double before = 0;
  for (const double segment_mm : {2.0, 1.0, 0.5}) {
    double worst = 0;
    for (const double hands : {0.5, 1.5, 2.5, 3.0}) {
      FreeStack both({TwistingArc(3, kCurvature, kRatio, segment_mm),
                      TwistingArc(3, kCurvature, kRatio, segment_mm)});
      both.MoveTo({{kLength, 0}, {kLength, 0}});
      both.MoveTo({{kLength, 0}, {kLength, hands}});
      worst = std::max(worst, std::abs(Between(both) - FreeEnd(hands, c, kLength)));
    }
    CAPTURE(segment_mm, worst);
    if (before > 0) CHECK(worst < 0.6 * before);
    before = worst;
  }
  CHECK(before < 0.02);
}

TEST_CASE(
    "Opposite arcs snap round where they are longer than pi/2 over c, and not where shorter") {
  constexpr double kCurvature = 0.05;
  constexpr double kRatio = 0.5;
  const double c = kCurvature / std::sqrt(kRatio);
  const double critical = kPi / 2 / c;
  const double part = GENERATE(0.9, 1.1);
  const double length = part * critical;
  FreeStack both({TwistingArc(3, kCurvature, kRatio), TwistingArc(3, kCurvature, kRatio)});
  both.MoveTo({{length, 0}, {length, 0}});
  // Past half a turn, a steadily following tip is past it too; a lagging tip is not.
  both.MoveTo({{length, 0}, {length, kPi - 0.02}});
  const double behind = kPi - 0.02 - Between(both);
  if (part < 1) {
    CHECK(behind < 0.4);
  } else {
    CHECK(behind > 0.8);
  }
}

TEST_CASE("A stack that is fed, pulled and turned takes the shape of one that was laid there") {
  const auto make = [] {
    return std::vector<WireModel>{TwistingArc(2, 0.03, 0.8), TwistingArc(3, 0.01, 0.5),
                                  TwistingArc(5, -0.02, 0.9)};
  };
  const InstrumentPoses poses{{43.2, 0.7}, {31.9, -0.4}, {17.3, 1.1}};
  FreeStack moved(make());
  moved.MoveTo({{20, 0}, {25, 1}, {5, 0}});
  moved.MoveTo({{60, -1}, {25.3, 1}, {22, 2}});
  moved.MoveTo(poses);
  FreeStack straight(make());
  straight.MoveTo(poses);
  CHECK(LargestDistance(moved.state, straight.state) < 1e-4);
  // Beyond the outer instrument's tip, no torque acts on this one.
  const int n = moved.state.segments();
  for (int joint = n - 10; joint < n; ++joint) {
    CHECK(std::abs(moved.state.TwistOf(joint, 2)) < 1e-6);
  }
}

TEST_CASE("The turn of an instrument is part of a state's hash") {
  TwistedStack stack(2, 7);
  const Eigen::VectorXd nothing = Eigen::VectorXd::Zero(stack.unknowns());
  const std::uint64_t same = HashState(StackStep(stack.model, stack.state, nothing));
  CHECK(HashState(StackStep(stack.model, stack.state, nothing)) == same);
  for (int k = 0; k < 2; ++k) {
    Eigen::VectorXd x = nothing;
    x[stack.each * 3 + 2 + k] = 1e-9;
    CHECK(HashState(StackStep(stack.model, stack.state, x)) != same);
  }
}

TEST_CASE("Feeding keeps the twist of each instrument while segments split and join") {
  const auto make = [](double ratio) { return TwistingArc(2, 0, ratio, 1); };
  InstrumentStack stack({make(1), make(0.5)});
  CombinedRods rods(stack);
  const WireModel& model = rods[0];
  const InstrumentPoses poses{{12.3, 0}, {12.3, 0}};
  rods.Combine(poses);
  WireState state = WireState::Along(model, {}, poses);
  const double rate[2] = {0.05, -0.03};  // rad/mm
  Eigen::VectorXd x(4 * state.segments());
  double along_mm = 0;
  for (int i = 0; i < state.segments(); ++i) {
    along_mm += JointLength(model, state, i);
    x.segment<4>(4 * i) << 0, 0, rate[0] * along_mm, rate[1] * along_mm;
  }
  state = StackStep(model, state, x);
  const PerInstrument at_tip = state.turns_rad().back();
  for (const double feed : {0.1, -0.1, 0.3, -0.35}) {
    for (int k = 0; k < 20; ++k) {
      state.Feed(model, state.insertion_mm() + feed);
      REQUIRE(static_cast<int>(state.turns_rad().size()) == state.segments());
      for (int m = 0; m < 2; ++m) {
        const auto instrument = static_cast<std::size_t>(m);
        CHECK(state.turns_rad().back()[instrument] == Approx(at_tip[instrument]).epsilon(1e-12));
        // Material new from the sheath has no twist yet, and never twists in the other direction.
        for (int i = 0; i + 1 < state.segments(); ++i) {
          const double twisted = state.TwistOf(i, m) / JointLength(model, state, i) / rate[m];
          CHECK(twisted > -1e-12);
          if (feed == 0.1) CHECK(twisted < 1.35);  // none has returned into the sheath yet
          if (i >= 8) CHECK(twisted == Approx(1).epsilon(1e-12));
        }
      }
    }
  }
}

TEST_CASE("The twist of an instrument that slides in another moves with it, unchanged") {
  TwistedStack stack(3, 9);
  const WireState& before = stack.state;
  const int n = before.segments();
  const double slid_mm = GENERATE(-0.4, 0.4);
  for (int k = 1; k < 3; ++k) {
    InstrumentPoses poses = before.poses();
    poses[k].insertion_mm += slid_mm;
    WireState after = before;
    after.MoveInstruments(stack.model, poses);
    // Per joint: the remaining twist, and the twist from the joint that it slides away from.
    const int from = slid_mm > 0 ? -1 : 1;
    for (int i = 1; i + 1 < n; ++i) {
      CAPTURE(k, slid_mm, i);
      const double stays = 1 - 0.4 / JointLength(stack.model, before, i);
      const double comes = 0.4 / JointLength(stack.model, before, i + from);
      CHECK(after.TwistOf(i, k) ==
            Approx(stays * before.TwistOf(i, k) + comes * before.TwistOf(i + from, k)));
      CHECK(after.TwistOf(i, 0) == Approx(before.TwistOf(i, 0)));
    }
  }
}

TEST_CASE("The twist of an instrument that slides far moves as in slides of a segment") {
  TwistedStack stack(3, 9);
  const double segment_mm = stack.model.segment_mm();
  for (int k = 1; k < 3; ++k) {
    WireState whole = stack.state;
    WireState stepped = stack.state;
    for (const double way : {-1, 1}) {
      InstrumentPoses poses = whole.poses();
      for (int step = 0; step < 3; ++step) {
        poses[k].insertion_mm += way * segment_mm;
        stepped.MoveInstruments(stack.model, poses);
      }
      whole.MoveInstruments(stack.model, poses);
      for (int i = 0; i < whole.segments(); ++i) {
        CAPTURE(k, way, i);
        CHECK(whole.TwistOf(i, k) == Approx(stepped.TwistOf(i, k)).margin(1e-12));
      }
    }
  }
}

}  // namespace
}  // namespace torquer::test
