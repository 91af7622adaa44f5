// Instruments on curves in contact: quadratic model, and the sweep against the dense Newton system.
#pragma once

#include <Eigen/Core>
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <utility>
#include <vector>

#include "host/simulator/core/newton/front_sweep.h"
#include "host/simulator/core/stack/combined_rods.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/dense_newton.h"
#include "tests/support/finite_differences.h"
#include "tests/support/twisted_stack.h"
#include "tests/support/wires.h"

namespace torquer::test {

// Curves whose state a test lays. Keeps a reference to `field`.
struct DenseCurves {
  InstrumentStack stack;
  CombinedRods rods{stack};
  const WireModel& model = rods[0];
  WallModel wall;
  EndForce force{Vector3d(1e-4, 2e-4, 3e-4)};
  std::vector<EnergyTerm*> terms{&force};  ///< more may be added before the first evaluation
  WireState state{model, stack.size()};
  WireMechanics mechanics;
  QuadraticModel at;
  // Model of a trial state. A new one for each energy takes most of the time of a dense Hessian.
  QuadraticModel trial;

  DenseCurves(std::vector<WireModel> instruments, const Clearance& clearance,
              const ClearanceField& field, const WallModel& of_wall)
      : stack(std::move(instruments), clearance),
        wall(of_wall),
        mechanics(rods, field, wall, terms),
        at(mechanics.MakeQuadraticModel()),
        trial(mechanics.MakeQuadraticModel()) {}

  // Pairs the curves at the state, and builds the model there.
  void Build() {
    mechanics.PairCurves(state);
    Forget();
    mechanics.BuildModel(state, at);
  }

  // Number of unknowns of a curve: for each segment a step, and a spin of each instrument.
  Eigen::Index Own(int curve) const {
    return (2 + rods[curve].spins()) * state.curve(curve).segments();
  }
  // First unknown of a curve.
  Eigen::Index First(int curve) const {
    Eigen::Index first = 0;
    for (int c = 0; c < curve; ++c) first += Own(c);
    return first;
  }
  Eigen::Index unknowns() const { return First(stack.curves()); }
  // State after the unknowns x.
  WireState Stepped(const Eigen::VectorXd& x) const {
    WireState to = state;
    for (int c = 0; c < stack.curves(); ++c) {
      to.curve(c) =
          StackStep(rods[c], state.curve(c), Eigen::VectorXd(x.segment(First(c), Own(c))));
    }
    return to;
  }
  void Forget() {
    for (int c = 0; c < stack.curves(); ++c) mechanics.points(c).Forget();
  }
  double Energy(const Eigen::VectorXd& x) {
    Forget();
    mechanics.BuildGradient(Stepped(x), trial);
    return trial.energy_mJ;
  }
  Eigen::VectorXd Gradient() const {
    Eigen::VectorXd gradient(unknowns());
    for (int c = 0; c < stack.curves(); ++c) {
      gradient.segment(First(c), Own(c)) = DenseGradient(rods[c], state.curve(c), at.curve(c));
    }
    return gradient;
  }
  // Diagonal for a weight of one.
  Eigen::VectorXd Unit() const {
    Eigen::VectorXd unit(unknowns());
    for (int c = 0; c < stack.curves(); ++c) {
      unit.segment(First(c), Own(c)) = UnitWeight(rods[c], state.curve(c));
    }
    return unit;
  }
  FrontSweep Sweep() const {
    std::vector<const WireModel*> of_curves;
    for (int c = 0; c < stack.curves(); ++c) of_curves.push_back(&rods[c]);
    return FrontSweep(of_curves, at.between);
  }
  // Unknowns of the steps of all curves.
  Eigen::VectorXd All(const std::vector<CurveStep>& steps) const {
    Eigen::VectorXd all(unknowns());
    for (int c = 0; c < stack.curves(); ++c) {
      const CurveStep& step = steps[static_cast<std::size_t>(c)];
      all.segment(First(c), Own(c)) = Unknowns(rods[c], step.xi, step.spin);
    }
    return all;
  }
  double PressedN() const {
    double sum = 0;
    for (const BetweenCurves& between : at.between) sum += between.pressed_N;
    return sum;
  }
  // True if no contact is so close to its limit that finite differences cross the kink.
  bool IsFarFromKinks() const {
    constexpr double kNearMm = 2e-3;
    bool far = true;
    const auto check = [&far](const auto& springs) {
      for (const auto& spring : springs) far = far && std::abs(spring.penetration_mm) > kNearMm;
    };
    for (const BetweenCurves& between : at.between) check(between.springs);
    for (int c = 0; c < stack.curves(); ++c) check(at.curve(c).springs);
    return far;
  }
};

// Compares the gradient of the model with finite differences.
inline void CheckGradient(DenseCurves& curves, double tolerance = 1e-7) {
  const Eigen::VectorXd gradient =
      GradientOf([&](const Eigen::VectorXd& x) { return curves.Energy(x); },
                 Eigen::VectorXd::Zero(curves.unknowns()), 3e-5);
  CHECK((gradient - curves.Gradient()).norm() < tolerance * gradient.norm());
}

// Compares a step of the sweep with that of the dense Newton system.
inline void CheckStep(DenseCurves& curves, double weight) {
  CAPTURE(weight);
  REQUIRE(curves.PressedN() > 0);
  Eigen::MatrixXd hessian = HessianOf([&](const Eigen::VectorXd& x) { return curves.Energy(x); },
                                      Eigen::VectorXd::Zero(curves.unknowns()), 2e-4);
  const Eigen::VectorXd unit = curves.Unit();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      hessian, Eigen::MatrixXd(unit.asDiagonal()));
  const double lift = -eigen.eigenvalues()[0];
  FrontSweep sweep = curves.Sweep();
  CHECK_FALSE(sweep.Factor(curves.state, curves.at, lift - 1e-3));
  CHECK(sweep.Factor(curves.state, curves.at, lift + 1e-3));

  hessian.diagonal() += (lift + weight) * unit;
  const Eigen::VectorXd dense = -hessian.llt().solve(curves.Gradient());
  REQUIRE(sweep.Factor(curves.state, curves.at, lift + weight));
  std::vector<CurveStep> steps(static_cast<std::size_t>(curves.stack.curves()));
  const double predicted = sweep.Step(curves.state, curves.at, steps);
  const Eigen::VectorXd swept = curves.All(steps);
  CHECK((swept - dense).norm() < 1e-5 * dense.norm());
  CHECK(predicted == Approx(-curves.Gradient().dot(dense) / 2).epsilon(1e-5));
  // A sweep resumed from the middle gives a bit-identical result.
  const int middle = sweep.schedule().OperationOf(0, 2);
  REQUIRE(middle > 0);
  REQUIRE(sweep.Refactor(curves.state, curves.at, lift + weight, middle));
  sweep.Step(curves.state, curves.at, steps);
  CHECK(curves.All(steps) == swept);
}

}  // namespace torquer::test
