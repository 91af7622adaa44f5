// Wire that twists: its quadratic model, its sweep and its frames.
#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/newton/riccati_sweep.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/dense_newton.h"
#include "tests/support/finite_differences.h"
#include "tests/support/roll_spring.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kRigidity = 6.35e-3;
constexpr double kRatio = 0.7;  // GJ / EI

// A twisted, bent wire with a curved tip, pressed into the wall of a torus, with a constant end
// force.
struct TwistedWire {
  WireModel model = MakeWire({.segment_mm = 1.3,
                              .rigidity_N_mm2 = kRigidity,
                              .torsional_rigidity_N_mm2 = kRatio * kRigidity,
                              .tip_mm = 5.2,
                              .tip_curvature_1_per_mm = 0.1,
                              .sheath = {Vector3d(21.8, 0, 0), Vector3d::UnitY()}});
  Torus field{Side::kInside, 20, 2};
  WallModel wall{.stiffness_N_mm2 = 2e-3};
  EndForce force{Vector3d(1e-4, 2e-4, 3e-4)};
  RollSpring roll{12};
  std::vector<EnergyTerm*> terms{&force, &roll};
  WireState state{model};
  WireMechanics mechanics{model, field, wall, terms};
  QuadraticModel at = mechanics.MakeQuadraticModel();

  explicit TwistedWire(unsigned seed) {
    std::mt19937 random(seed);
    std::vector<Vector3d> arc;  // along the outer wall
    for (double a = 0.02; a < 1; a += 0.02) {
      arc.emplace_back(22 * std::cos(a), 22 * std::sin(a), 0.2);
    }
    state = WireState::Along(model, arc, {15.1, 0});
    Shake(model, 0.03, random, state);
    std::uniform_real_distribution<double> spin(-0.3, 0.3);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(3 * state.segments());
    double sum = 0;
    for (int i = 0; i < state.segments(); ++i) x[3 * i + 2] = (sum += 0.2 + spin(random));
    state = StepAndSpin(model, state, x);
    mechanics.BuildModel(state, at);
    roll.Begin(at.points);
    mechanics.BuildModel(state, at);
  }

  double Energy(const Eigen::VectorXd& x) {
    QuadraticModel there = mechanics.MakeQuadraticModel();
    mechanics.points().Forget();
    mechanics.BuildGradient(StepAndSpin(model, state, x), there);
    return there.energy_mJ;
  }
  Eigen::VectorXd Gradient() const { return DenseGradient(model, state, at); }
};

TEST_CASE("Gradient and residual of a wire that twists are those of finite differences") {
  TwistedWire wire(3);
  REQUIRE(wire.at.max_penetration_mm > 0.05);
  REQUIRE(wire.state.twist_rad()[2] != 0);
  const Eigen::VectorXd gradient =
      GradientOf([&](const Eigen::VectorXd& x) { return wire.Energy(x); },
                 Eigen::VectorXd::Zero(3 * wire.state.segments()), 1e-4);
  const Eigen::VectorXd ours = wire.Gradient();
  CHECK((gradient - ours).norm() < 1e-7 * gradient.norm());
  double residual = 0;
  for (int i = 0; i < wire.state.segments(); ++i) {
    residual =
        std::max({residual, ours.segment<2>(3 * i).norm(), std::abs(ours[3 * i + 2]) / kRatio});
  }
  CHECK(wire.at.residual == Approx(residual / kRigidity));
}

TEST_CASE("The sweep of a wire that twists solves the dense Newton system") {
  const double weight = GENERATE(0.1, 10.0);
  TwistedWire wire(5);
  const Eigen::Index unknowns = 3 * wire.state.segments();
  const Eigen::MatrixXd hessian =
      HessianOf([&](const Eigen::VectorXd& x) { return wire.Energy(x); },
                Eigen::VectorXd::Zero(unknowns), 3e-3);
  Eigen::VectorXd unit = Eigen::VectorXd::Constant(unknowns, kRigidity);
  for (Eigen::Index i = 2; i < unknowns; i += 3) unit[i] *= kRatio;
  RiccatiSweep<TwistStage> sweep(wire.model.max_segments());
  CheckSweepIsDense(sweep, wire.model, wire.state, wire.at, hessian, unit, weight);
}

TEST_CASE("Twist is the turn of the material against the untwisted frame, and counts whole turns") {
  const WireModel model = MakeWire({.segment_mm = 1, .torsional_rigidity_N_mm2 = 1});
  WireState state = LayStraight(model, 10);
  for (int turn = 0; turn < 40; ++turn) {  // distal end, 0.5 rad at a time, to 20 rad
    Eigen::VectorXd x = Eigen::VectorXd::Zero(30);
    for (int i = 5; i < 10; ++i) x[3 * i + 2] = 0.5;
    state = StepAndSpin(model, state, x);
  }
  for (int i = 0; i < 10; ++i) CHECK(state.twist_rad()[i] == Approx(i == 5 ? 20 : 0).margin(1e-12));
  state.UntwistFrames(model);
  for (const double twist : state.twist_rad()) CHECK(twist == 0);
}

TEST_CASE("Feeding keeps the twist per length while segments split and join") {
  const WireModel model =
      MakeWire({.segment_mm = 1, .torsional_rigidity_N_mm2 = 1, .max_length_mm = 40});
  WireState state = LayStraight(model, 12.3);
  constexpr double kRate = 0.05;  // rad/mm
  Eigen::VectorXd x = Eigen::VectorXd::Zero(3 * state.segments());
  double along = 0;
  for (int i = 0; i < state.segments(); ++i) {
    along += JointLength(model, state, i);
    x[3 * i + 2] = kRate * along;
  }
  state = StepAndSpin(model, state, x);
  const auto total = [&] {
    double sum = 0;
    for (const double twist : state.twist_rad()) sum += twist;
    return sum;
  };
  const double before = total();
  double largest = 0;
  for (const double feed : {0.1, -0.1, 0.3, -0.35}) {
    for (int k = 0; k < 20; ++k) {
      state.Feed(model, state.insertion_mm() + feed);
      REQUIRE(static_cast<int>(state.twist_rad().size()) == state.segments());
      CHECK(total() == Approx(before).epsilon(1e-12));
      // Material new from the sheath has no twist yet; the rate beyond stays constant.
      for (int i = 8; i + 1 < state.segments(); ++i) {
        CHECK(state.twist_rad()[i] == Approx(kRate).epsilon(1e-12));
      }
      // The frames agree with the stored twist.
      const std::vector<double> kept = state.twist_rad();
      state.UpdateFrames(model);
      for (std::size_t i = 0; i < kept.size(); ++i) {
        largest = std::max(largest, std::abs(kept[i] - state.twist_rad()[i]));
      }
    }
  }
  CHECK(largest < 1e-12);
}

TEST_CASE("A free wire turns with the hand, without twist") {
  const WireModel model = MakeWire({.segment_mm = 1,
                                    .torsional_rigidity_N_mm2 = 1e-3,
                                    .tip_mm = 6,
                                    .tip_curvature_1_per_mm = 0.15});
  const WireModel stiff = MakeWire({.segment_mm = 1, .tip_mm = 6, .tip_curvature_1_per_mm = 0.15});
  const FreeSpace field;
  const WallModel wall;
  const std::vector<EnergyTerm*> none;
  WireState twisting = LayStraight(model, 20);
  WireState rigid = LayStraight(stiff, 20);
  const auto a = MakeNewtonRelaxation(model, field, wall, {}, none);
  const auto b = MakeNewtonRelaxation(stiff, field, wall, {}, none);
  a->Restart(twisting);
  b->Restart(rigid);
  REQUIRE(Settle(*a, {25, 2.0}, twisting).converged);
  REQUIRE(Settle(*b, {25, 2.0}, rigid).converged);
  CHECK(LargestDistance(twisting, rigid) < 1e-4);
  // Twist that the residual allows: 1e-6 EI/mm over GJ at each joint.
  for (const double twist : twisting.twist_rad()) CHECK(std::abs(twist) < 1e-6 * 6.35 * 25);
}

}  // namespace
}  // namespace torquer::test
