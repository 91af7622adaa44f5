// Checks that every clearance field must pass, shared by this folder's tests.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <vector>

#include "catch2/catch.hpp"
#include "host/simulator/core/clearance_field.h"

namespace torquer::vessel {

/// Small generator (splitmix64) with the same numbers on every machine.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(Next() >> 11) * 0x1p-53;
  }
  Eigen::Vector3d InBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
    return {Uniform(low.x(), high.x()), Uniform(low.y(), high.y()), Uniform(low.z(), high.z())};
  }
  Eigen::Vector3d Direction() {
    while (true) {
      const Eigen::Vector3d v = InBox({-1, -1, -1}, {1, 1, 1});
      if (v.norm() > 0.1 && v.norm() < 1) return v.normalized();
    }
  }
  uint64_t Next() {
    uint64_t z = (state_ += 0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }

 private:
  uint64_t state_;
};

/// Numbers from `from` to below `to` in steps.
inline std::vector<double> Steps(double from, double to, double step) {
  std::vector<double> numbers;
  for (int i = 0; from + i * step < to; ++i) numbers.push_back(from + i * step);
  return numbers;
}

/// Largest deviation of the field's gradient and Hessian from central differences of its value and
/// gradient.
struct DerivativeErrors {
  double gradient = 0;
  double hessian = 0;
};

inline DerivativeErrors CheckDerivatives(const ClearanceField& field, const Eigen::Vector3d& p,
                                         double step_mm) {
  ClearanceSample at, plus, minus, gradient_only;
  field.EvaluateHessian(p, at);
  field.EvaluateGradient(p, gradient_only);
  // All three look-ups give the same value.
  CHECK(field.Clearance(p) == at.clearance_mm);
  CHECK(gradient_only.clearance_mm == at.clearance_mm);
  CHECK((gradient_only.gradient - at.gradient).norm() < 1e-14);
  CHECK((at.hessian - at.hessian.transpose()).norm() < 1e-12 * (1 + at.hessian.norm()));
  DerivativeErrors errors;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = step_mm * Eigen::Vector3d::Unit(axis);
    field.EvaluateGradient(p + step, plus);
    field.EvaluateGradient(p - step, minus);
    errors.gradient = std::max(
        errors.gradient,
        std::abs((plus.clearance_mm - minus.clearance_mm) / (2 * step_mm) - at.gradient[axis]));
    errors.hessian =
        std::max(errors.hessian,
                 ((plus.gradient - minus.gradient) / (2 * step_mm) - at.hessian.col(axis)).norm());
  }
  return errors;
}

}  // namespace torquer::vessel
