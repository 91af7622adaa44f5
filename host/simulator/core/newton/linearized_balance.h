// The linearized balance of Newton's method, by its own mechanics and sweep.
#pragma once

#include <vector>

#include "host/simulator/core/newton/part_follower.h"
#include "host/simulator/core/newton/step_solver.h"
#include "host/simulator/core/wire_mechanics.h"

namespace torquer {

/// Replaces all gradients of a curve's quadratic model, so that Newton's step solves Hessian * step
/// = - `gradient`. The forces that stiffen the wire stay.
void ReplaceGradients(const CurveStep& gradient, CurveQuadraticModel& model);

template <class Sweep>
class SweepBalance final : public LinearizedBalance {
 public:
  /// Keeps references. `model`: work space.
  SweepBalance(WireMechanics& mechanics, StepSolver<Sweep>& solver, QuadraticModel& model)
      : mechanics_(mechanics), solver_(solver), model_(model) {}

  bool Factor(const WireState& state) override {
    mechanics_.BuildModel(state, model_);
    return solver_.IsDefinite(state, model_, 0);
  }
  const std::vector<Frame>& frames() const override { return model_.frames; }
  const CurveStep& Solve(const WireState& state, const CurveStep& gradient) override {
    ReplaceGradients(gradient, model_);
    return solver_.StepOf(state, model_);
  }

 private:
  WireMechanics& mechanics_;
  StepSolver<Sweep>& solver_;
  QuadraticModel& model_;
};

}  // namespace torquer
