#include "tests/support/dense_curves.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <utility>

#include "tests/support/dense_newton.h"
#include "tests/support/finite_differences.h"
#include "tests/support/twisted_stack.h"

namespace torquer::test {

DenseCurves::DenseCurves(std::vector<WireModel> instruments, const Clearance& clearance,
                         const ClearanceField& field, const WallModel& of_wall)
    : stack(std::move(instruments), clearance),
      wall(of_wall),
      mechanics(rods, field, wall, terms),
      at(mechanics.MakeQuadraticModel()),
      trial(mechanics.MakeQuadraticModel()) {}

void DenseCurves::Build() {
  mechanics.PairCurves(state);
  Forget();
  mechanics.BuildModel(state, at);
}

Eigen::Index DenseCurves::First(int curve) const {
  Eigen::Index first = 0;
  for (int c = 0; c < curve; ++c) first += Own(c);
  return first;
}

WireState DenseCurves::Stepped(const Eigen::VectorXd& x) const {
  WireState to = state;
  for (int c = 0; c < stack.curves(); ++c) {
    to.curve(c) = StackStep(rods[c], state.curve(c), Eigen::VectorXd(x.segment(First(c), Own(c))));
  }
  return to;
}

void DenseCurves::Forget() {
  for (int c = 0; c < stack.curves(); ++c) mechanics.points(c).Forget();
}

double DenseCurves::Energy(const Eigen::VectorXd& x) {
  Forget();
  mechanics.BuildGradient(Stepped(x), trial);
  return trial.energy_mJ;
}

Eigen::VectorXd DenseCurves::Gradient() const {
  Eigen::VectorXd gradient(unknowns());
  for (int c = 0; c < stack.curves(); ++c) {
    gradient.segment(First(c), Own(c)) = DenseGradient(rods[c], state.curve(c), at.curve(c));
  }
  return gradient;
}

Eigen::VectorXd DenseCurves::Unit() const {
  Eigen::VectorXd unit(unknowns());
  for (int c = 0; c < stack.curves(); ++c) {
    unit.segment(First(c), Own(c)) = UnitWeight(rods[c], state.curve(c));
  }
  return unit;
}

FrontSweep DenseCurves::Sweep() const {
  std::vector<const WireModel*> of_curves;
  for (int c = 0; c < stack.curves(); ++c) of_curves.push_back(&rods[c]);
  return FrontSweep(of_curves, at.between);
}

Eigen::VectorXd DenseCurves::All(const std::vector<CurveStep>& steps) const {
  Eigen::VectorXd all(unknowns());
  for (int c = 0; c < stack.curves(); ++c) {
    const CurveStep& step = steps[static_cast<std::size_t>(c)];
    all.segment(First(c), Own(c)) = Unknowns(rods[c], step.xi, step.spin);
  }
  return all;
}

double DenseCurves::PressedN() const {
  double sum = 0;
  for (const BetweenCurves& between : at.between) sum += between.pressed_N;
  return sum;
}

bool DenseCurves::IsFarFromKinks() const {
  constexpr double kNearMm = 2e-3;
  bool far = true;
  const auto check = [&far](const auto& springs) {
    for (const auto& spring : springs) far = far && std::abs(spring.penetration_mm) > kNearMm;
  };
  for (const BetweenCurves& between : at.between) check(between.springs);
  for (int c = 0; c < stack.curves(); ++c) check(at.curve(c).springs);
  return far;
}

void CheckGradient(DenseCurves& curves, double tolerance) {
  const Eigen::VectorXd gradient =
      GradientOf([&](const Eigen::VectorXd& x) { return curves.Energy(x); },
                 Eigen::VectorXd::Zero(curves.unknowns()), 3e-5);
  CHECK((gradient - curves.Gradient()).norm() < tolerance * gradient.norm());
}

void CheckStep(DenseCurves& curves, double weight) {
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
