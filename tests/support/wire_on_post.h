// Test bench of the capstan law.
#pragma once

#include <cmath>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {

/// A wire, 60 mm past its sheath, around a post of 10 mm radius. A force at its end holds it, at
/// 2.5 rad from the sheath.
struct WireOnPost {
  static constexpr double kRadius = 10;
  static constexpr double kPull_rad = 2.5;
  struct Setup {
    double mu = 0;
    double force_N = 0.05;
    double rigidity_N_mm2 = 6.35e-3;
    double segment_mm = 0.5;
    int points_per_segment = 2;
  };
  WallModel wall;
  WireModel model;
  Cylinder post{Side::kOutside, Vector3d::Zero(), Vector3d::UnitZ(), kRadius - 0.2};
  effects::Friction friction;
  EndForce force;
  std::vector<EnergyTerm*> terms;
  NewtonRelaxation relaxation;
  WireState state;

  explicit WireOnPost(const Setup& setup)
      : wall{.stiffness_N_mm2 = 100, .points_per_segment = setup.points_per_segment},
        model(MakeWire({.segment_mm = setup.segment_mm,
                        .rigidity_N_mm2 = setup.rigidity_N_mm2,
                        .radius_mm = 0.2,
                        .sheath = {Vector3d(0, -kRadius, 0), Vector3d::UnitX()}})),
        friction(setup.mu, 0.005, {model, wall}),
        force(setup.force_N * Vector3d(std::cos(kPull_rad), std::sin(kPull_rad), 0)),
        terms{&friction, &force},
        relaxation(model, post, wall, {}, terms),
        state(model) {
    std::vector<Vector3d> path;
    for (double a = 0.02; a < kPull_rad; a += 0.02) {
      path.emplace_back(kRadius * std::sin(a), -kRadius * std::cos(a), 0);
    }
    state = WireState::Along(model, path, {60, 0});
    relaxation.Restart(state);
  }
  /// Node at the given angle around the post, measured from the sheath.
  std::size_t NodeAt(double angle_rad) const {
    return static_cast<std::size_t>(std::lround(angle_rad * kRadius / model.segment_mm()));
  }
};

}  // namespace torquer::test
