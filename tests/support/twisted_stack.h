// Bent, nested, twisted instruments in the wall of a torus.
#pragma once

#include <Eigen/Core>
#include <random>
#include <vector>

#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/roll_spring.h"
#include "tests/support/wires.h"

namespace torquer::test {

// State after x: for each segment a step, and a spin of each instrument.
template <class AnyCurve>
AnyCurve StackStep(const WireModel& model, const AnyCurve& from, const Eigen::VectorXd& x) {
  const int spins = model.spins();
  const Eigen::Index each = 2 + spins;
  std::vector<Frame> frames;
  std::vector<Vector2d> xi;
  std::vector<double> zeta;
  for (int i = 0; i < from.segments(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    frames.push_back(TangentFrame(from.tangents()[at], from.normals()[at]));
    xi.emplace_back(x.segment<2>(each * i));
    for (int k = 0; k < spins; ++k) zeta.push_back(x[each * i + 2 + k]);
  }
  AnyCurve to = from;
  to.Step(model, from, frames, xi, zeta, 1);
  return to;
}

inline WireModel Bent(double rigidity, double ratio, double curved_mm, double curvature_1,
                      double curvature_2, double radius, const Sheath& sheath,
                      double segment_mm = 1.3) {
  const double gj = ratio * rigidity;
  return WireModel(segment_mm,
                   {{0, rigidity, radius, curvature_1, curvature_2, gj},
                    {curved_mm, 1.4 * rigidity, radius, curvature_1, curvature_2, 1.2 * gj},
                    {curved_mm + 1e-6, 1.4 * rigidity, radius, 0, 0, 1.2 * gj}},
                   0, 60, BendingLaw::kExact, sheath);
}

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

  static std::vector<WireModel> Instruments(int count, const Sheath& sheath) {
    std::vector<WireModel> all;
    const double curvatures[4][2] = {{0.1, 0}, {0.03, 0.08}, {-0.05, 0.02}, {0.02, -0.02}};
    for (int k = 0; k < count; ++k) {
      all.push_back(Bent(kSoftest * (1 + 0.5 * k), kRatio, 5.2 + 2 * k, curvatures[k][0],
                         curvatures[k][1], 0.2 + 0.2 * k, sheath));
    }
    return all;
  }

  TwistedStack(int count, unsigned seed) : stack(Instruments(count, sheath)) {
    std::mt19937 random(seed);
    std::vector<Vector3d> arc;
    for (double a = 0.02; a < 1; a += 0.02) {
      arc.emplace_back(22 * std::cos(a), 22 * std::sin(a), 0.2);
    }
    const InstrumentPose all[4] = {{15.1, 0.4}, {11.3, -0.8}, {8.0, 2}, {3.9, 0}};
    InstrumentPoses poses(count);
    for (int k = 0; k < count; ++k) poses[k] = all[k];
    rods.Combine(poses);
    state = WireState::Along(model, arc, poses);
    Shake(model, 0.03, random, state);
    std::uniform_real_distribution<double> spin(-0.3, 0.3);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(unknowns());
    PerInstrument sum = {};
    for (int i = 0; i < state.segments(); ++i) {
      for (int k = 0; k < count; ++k) {
        sum[static_cast<std::size_t>(k)] += 0.2 - 0.15 * k + spin(random);
        x[each * i + 2 + k] = sum[static_cast<std::size_t>(k)];
      }
    }
    state = StackStep(model, state, x);
    mechanics.BuildModel(state, at);
    roll.Begin(at.points);
    mechanics.BuildModel(state, at);
  }

  Eigen::Index unknowns() const { return each * state.segments(); }
  double Energy(const Eigen::VectorXd& x) {
    mechanics.points().Forget();
    mechanics.BuildGradient(StackStep(model, state, x), trial);
    return trial.energy_mJ;
  }
};

}  // namespace torquer::test
