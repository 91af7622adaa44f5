#include "tests/support/finite_differences.h"

namespace torquer::test {

Eigen::VectorXd GradientOf(const ScalarFunction& f, const Eigen::VectorXd& x, double h) {
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

Eigen::MatrixXd JacobianOf(const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& gradient,
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

Eigen::MatrixXd HessianOf(const ScalarFunction& f, const Eigen::VectorXd& x, double h) {
  const double middle = f(x);
  Eigen::VectorXd at = x;
  const auto second = [&](Eigen::Index i, Eigen::Index j) {
    const auto value = [&](double step) {
      at[i] = x[i] + step;
      at[j] = x[j] + step;
      const double v = f(at);
      at[i] = x[i];
      at[j] = x[j];
      return v;
    };
    return (16 * (value(h) + value(-h)) - (value(2 * h) + value(-2 * h)) - 30 * middle) /
           (12 * h * h);
  };
  Eigen::MatrixXd m(x.size(), x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) m(i, i) = second(i, i);
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      m(i, j) = m(j, i) = (second(i, j) - m(i, i) - m(j, j)) / 2;
    }
  }
  return m;
}

std::vector<Eigen::Vector2d> Steps(const Eigen::VectorXd& x) {
  std::vector<Eigen::Vector2d> steps;
  for (Eigen::Index i = 0; i + 1 < x.size(); i += 2) steps.emplace_back(x[i], x[i + 1]);
  return steps;
}

}  // namespace torquer::test
