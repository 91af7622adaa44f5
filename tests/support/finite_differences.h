// Derivatives by central differences, of fourth order in the step.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace torquer::test {

using ScalarFunction = std::function<double(const Eigen::VectorXd&)>;

Eigen::VectorXd GradientOf(const ScalarFunction& f, const Eigen::VectorXd& x, double h);

/// Jacobian of a gradient by differences, symmetrized.
Eigen::MatrixXd JacobianOf(const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& gradient,
                           const Eigen::VectorXd& x, double h);

/// Second derivatives by polarization: those along e_i + e_j, e_i and e_j give the mixed one. It
/// takes an eighth of the values that differences of GradientOf would take.
Eigen::MatrixXd HessianOf(const ScalarFunction& f, const Eigen::VectorXd& x, double h);

/// Converts a vector of 2 n numbers to n steps.
std::vector<Eigen::Vector2d> Steps(const Eigen::VectorXd& x);

}  // namespace torquer::test
