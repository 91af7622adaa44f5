// Derivatives by central differences, of fourth order in the step.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace torquer::test {

using ScalarFunction = std::function<double(const Eigen::VectorXd&)>;

inline Eigen::VectorXd GradientOf(const ScalarFunction& f, const Eigen::VectorXd& x, double h) {
  Eigen::VectorXd g(x.size());
  Eigen::VectorXd at = x;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const auto value = [&](double step) {
      at[i] = x[i] + step;
      const double v = f(at);
      at[i] = x[i];
      return v;
    };
    g[i] = (8 * (value(h) - value(-h)) - (value(2 * h) - value(-2 * h))) / (12 * h);
  }
  return g;
}

/// Jacobian of a gradient by differences, symmetrized.
inline Eigen::MatrixXd JacobianOf(
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& gradient,
    const Eigen::VectorXd& x, double h) {
  Eigen::MatrixXd m(x.size(), x.size());
  Eigen::VectorXd at = x;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const auto value = [&](double step) {
      at[i] = x[i] + step;
      Eigen::VectorXd v = gradient(at);
      at[i] = x[i];
      return v;
    };
    m.col(i) = (8 * (value(h) - value(-h)) - (value(2 * h) - value(-2 * h))) / (12 * h);
  }
  return (m + m.transpose()) / 2;
}

inline Eigen::MatrixXd HessianOf(const ScalarFunction& f, const Eigen::VectorXd& x, double h) {
  return JacobianOf([&](const Eigen::VectorXd& at) { return GradientOf(f, at, h); }, x, h);
}

/// Converts a vector of 2 n numbers to n steps.
inline std::vector<Eigen::Vector2d> Steps(const Eigen::VectorXd& x) {
  std::vector<Eigen::Vector2d> steps;
  for (Eigen::Index i = 0; i + 1 < x.size(); i += 2) steps.emplace_back(x[i], x[i + 1]);
  return steps;
}

}  // namespace torquer::test
