#include "tests/support/dense_newton.h"

#include <Eigen/Dense>
#include <algorithm>
#include <catch2/catch.hpp>

namespace torquer::test {

Eigen::VectorXd DenseGradient(const WireModel& model, const Curve& state,
                              const CurveQuadraticModel& at) {
  const Eigen::Index spins = model.spins();
  const Eigen::Index each = 2 + spins;
  Eigen::VectorXd gradient(each * state.segments());
  for (Eigen::Index i = 0; i < state.segments(); ++i) {
    gradient.segment<2>(each * i) = at.gradient[static_cast<std::size_t>(i)];
    for (Eigen::Index k = 0; k < spins; ++k) {
      gradient[each * i + 2 + k] = at.spin_gradient[static_cast<std::size_t>(i * spins + k)];
    }
  }
  return gradient;
}

Eigen::VectorXd Unknowns(const WireModel& model, const std::vector<Vector2d>& step,
                         const std::vector<double>& spin) {
  const auto spins = static_cast<std::size_t>(model.spins());
  Eigen::VectorXd all(static_cast<Eigen::Index>(step.size() * (2 + spins)));
  Eigen::Index at = 0;
  for (std::size_t i = 0; i < step.size(); ++i) {
    for (const double component : step[i]) all[at++] = component;
    for (std::size_t k = 0; k < spins; ++k) all[at++] = spin[i * spins + k];
  }
  return all;
}

Eigen::VectorXd UnitWeight(const WireModel& model, const Curve& state) {
  const Eigen::Index each = 2 + model.spins();
  const int n = state.segments();
  Eigen::VectorXd unit(each * n);
  for (int i = 0; i < n; ++i) {
    unit.segment<2>(each * i).setConstant(
        std::min(model.rigidity_N_mm2(n - i), model.rigidity_N_mm2(n - i - 1)));
    if (model.twists()) {
      unit[each * i + 2] = std::min(model.torsional_rigidity_N_mm2(n - i),
                                    model.torsional_rigidity_N_mm2(n - i - 1));
      continue;
    }
    for (int k = 0; k < model.spins(); ++k) {
      const auto at = static_cast<std::size_t>(model.first_spin() + k);
      unit[each * i + 2 + k] =
          std::min(model.twisting_joint(n - i).of[at].torsional_rigidity_N_mm2,
                   model.twisting_joint(n - i - 1).of[at].torsional_rigidity_N_mm2);
    }
  }
  return unit;
}

void CheckStepIsDense(const SweepCalls& sweep, const WireModel& model, const WireState& state,
                      const QuadraticModel& at, Eigen::MatrixXd hessian,
                      const Eigen::VectorXd& unit, double weight) {
  // The Hessian stops being positive definite at minus its smallest eigenvalue as weight.
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      hessian, Eigen::MatrixXd(unit.asDiagonal()));
  const double lift = -eigen.eigenvalues()[0];
  CHECK_FALSE(sweep.factor(lift - 1e-3));
  CHECK(sweep.factor(lift + 1e-3));

  hessian.diagonal() += (lift + weight) * unit;
  const Eigen::VectorXd gradient = DenseGradient(model, state, at);
  const Eigen::VectorXd dense = -hessian.llt().solve(gradient);
  REQUIRE(sweep.factor(lift + weight));
  std::vector<CurveStep> steps(1);
  const double predicted = sweep.step(steps);
  const CurveStep& step = steps.front();
  CHECK((Unknowns(model, step.xi, step.spin) - dense).norm() < 1e-5 * dense.norm());
  CHECK(predicted == Approx(-gradient.dot(dense) / 2).epsilon(1e-5));
}

}  // namespace torquer::test
