// Bent, nested, twisted instruments in the wall of a torus.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/roll_spring.h"
#include "tests/support/wires.h"

namespace torquer::test {

// State after x: for each segment a step, and a spin of each instrument. Curves and whole states.
template <class AnyCurve>
AnyCurve StackStep(const WireModel& model, const AnyCurve& from, const Eigen::VectorXd& x);

WireModel Bent(double rigidity, double ratio, double curved_mm, double curvature_1,
               double curvature_2, double radius, const Sheath& sheath, double segment_mm = 1.3);

// Two to four bent instruments, twisted by different amounts, in the wall of a torus. Their tips
// are at any place within a segment.
struct TwistedStack {
  static constexpr double kRatio = 0.7;
  static constexpr double kSoftest = 6.35e-3;  // N mm^2
  Sheath sheath{Vector3d(21.8, 0, 0), Vector3d::UnitY()};
  InstrumentStack stack;
  CombinedRods rods{stack};
  const WireModel& model = rods[0];
  Torus field{Side::kInside, 20, 2};
  WallModel wall{.stiffness_N_mm2 = 2e-3};
  EndForce force{Vector3d(1e-4, 2e-4, 3e-4)};
  RollSpring roll{8};
  BetweenSpring between{4};
  std::vector<EnergyTerm*> terms{&force, &roll, &between};
  WireState state{model, stack.size()};
  WireMechanics mechanics{rods, field, wall, terms};
  QuadraticModel at = mechanics.MakeQuadraticModel();
  // Model of a trial state. A new one for each energy takes most of the time of a dense Hessian.
  QuadraticModel trial = mechanics.MakeQuadraticModel();
  Eigen::Index each = 2 + stack.size();

  TwistedStack(int count, unsigned seed);

  Eigen::Index unknowns() const { return each * state.segments(); }
  double Energy(const Eigen::VectorXd& x);
};

}  // namespace torquer::test
