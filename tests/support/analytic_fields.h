// Small vessels of host/study, under names for tests.
#pragma once

#include <Eigen/Core>

#include "host/study/cases/analytic_fields.h"

namespace torquer::test {

using study::AnalyticField;
using study::Capsule;
using study::Cylinder;
using study::FreeSpace;
using study::HalfSpace;
using study::RoundWall;
using study::Side;
using study::Torus;

/// A ball around the origin.
class Ball final : public RoundWall {
 public:
  using RoundWall::RoundWall;
  void EvaluateHessian(const Eigen::Vector3d& p, ClearanceSample& out) const override {
    FromOffset(p, Eigen::Matrix3d::Identity(), out);
  }
};

}  // namespace torquer::test
