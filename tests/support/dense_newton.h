// Comparison of the sweep's step with the dense Newton system.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <type_traits>
#include <utility>
#include <vector>

#include "host/simulator/core/newton/front_sweep.h"
#include "host/simulator/core/wire_mechanics.h"
#include "tests/support/wires.h"

namespace torquer::test {

/// Gradient with respect to all unknowns: for each segment its step, then its spins.
Eigen::VectorXd DenseGradient(const WireModel& model, const Curve& state,
                              const CurveQuadraticModel& at);

/// Steps and spins of all segments, in the order of DenseGradient.
Eigen::VectorXd Unknowns(const WireModel& model, const std::vector<Vector2d>& step,
                         const std::vector<double>& spin);

/// Diagonal for a weight of one: the softer of a segment's two joints. `state` is the curve of
/// `model`.
Eigen::VectorXd UnitWeight(const WireModel& model, const Curve& state);

/// Calls of one sweep, whatever its type.
struct SweepCalls {
  std::function<bool(double weight)> factor;            ///< false: not positive definite
  std::function<double(std::vector<CurveStep>&)> step;  ///< returns the predicted decrease, mJ
};

/// See CheckSweepIsDense.
void CheckStepIsDense(const SweepCalls& sweep, const WireModel& model, const WireState& state,
                      const QuadraticModel& at, Eigen::MatrixXd hessian,
                      const Eigen::VectorXd& unit, double weight);

/// Checks that the sweep is positive definite exactly if `hessian` (of all unknowns) plus the
/// weight is. Also checks that its step solves the system with a larger weight. `unit` is the
/// diagonal for a weight of one.
template <class Sweep>
void CheckSweepIsDense(Sweep& sweep, const WireModel& model, const WireState& state,
                       const QuadraticModel& at, Eigen::MatrixXd hessian,
                       const Eigen::VectorXd& unit, double weight) {
  SweepCalls calls;
  if constexpr (std::is_same_v<Sweep, FrontSweep>) {
    calls = {[&](double with) { return sweep.Factor(state, at, with); },
             [&](std::vector<CurveStep>& steps) { return sweep.Step(state, at, steps); }};
  } else {
    calls = {[&](double with) { return sweep.Factor(model, state, at, with); },
             [&](std::vector<CurveStep>& steps) {
               CurveStep& step = steps.front();
               return sweep.Step(model, state, at, step.xi, step.spin, step.displacement_mm);
             }};
  }
  CheckStepIsDense(calls, model, state, at, std::move(hessian), unit, weight);
}

}  // namespace torquer::test
