// A bent wire in a bent catheter that leaves it room.
#pragma once

#include <Eigen/Core>
#include <random>
#include <vector>

#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/finite_differences.h"
#include "tests/support/twisted_stack.h"
#include "tests/support/wires.h"

namespace torquer::test {

// A bent wire in a bent catheter that leaves it room, both shaken, in the wall of a torus. Tips
// fall anywhere within a segment.
struct TwoCurves {
  static constexpr double kSoftest = 6.35e-3;  // N mm^2
  Sheath sheath{Vector3d(21.8, 0, 0), Vector3d::UnitY()};
  InstrumentStack stack;
  const WireModel& model = stack.rod();
  const WireModel& second = *stack.second_rod();
  Torus field{Side::kInside, 20, 2};
  WallModel wall;
  EndForce force{Vector3d(1e-4, 2e-4, 3e-4)};
  std::vector<EnergyTerm*> terms{&force};  ///< others may be added before the first evaluation
  WireState state{model, 2};
  WireMechanics mechanics;
  Expansion at;

  static std::vector<WireModel> Instruments(const Sheath& sheath) {
    std::vector<WireModel> all;
    all.push_back(Bent(kSoftest, 0, 5.2, 0.1, 0, 0.2, sheath));
    all.push_back(Bent(2 * kSoftest, 0, 4.1, 0.02, -0.03, 0.5, sheath));
    return all;
  }

  TwoCurves(const InstrumentPlaces& places, int points_per_segment, unsigned seed)
      : stack(Instruments(sheath),
              {.first_outer = 1, .lumen_radius_mm = {0, 0.28}, .stiffness_N_mm2 = 2e-3}),
        wall{.stiffness_N_mm2 = 2e-3, .points_per_segment = points_per_segment},
        mechanics(model, field, wall, terms, &stack),
        at(mechanics.MakeExpansion()) {
    std::mt19937 random(seed);
    std::vector<Vector3d> arc;
    for (double a = 0.02; a < 1; a += 0.02) {
      arc.emplace_back(22 * std::cos(a), 22 * std::sin(a), 0.2);
    }
    state = WireState::Along(model, arc, places);
    Shake(model, 0.03, random, state);
    state.LaySecond(second, stack.SecondReach(places), 1, stack.OuterLeads(places));
    stack.Combine(places, state.segments() - state.second()->segments());
    mechanics.points().TakeRadii();
    std::uniform_real_distribution<double> turn(-0.04, 0.04);
    Eigen::VectorXd x(unknowns());
    for (double& component : x) component = turn(random);
    state = Stepped(x);
    mechanics.Expand(state, at);
  }

  Eigen::Index unknowns() const { return 2 * (state.segments() + state.second()->segments()); }
  // After the steps x of the first curve, then of the second.
  WireState Stepped(const Eigen::VectorXd& x) const {
    const auto frames = [](const WireState& curve) {
      std::vector<Frame> all;
      for (std::size_t i = 0; i < curve.tangents().size(); ++i) {
        all.push_back(TangentFrame(curve.tangents()[i], curve.normals()[i]));
      }
      return all;
    };
    const Eigen::Index first = 2 * state.segments();
    WireState to = state;
    to.Step(model, state, frames(state), Steps(x.head(first)), {}, 1);
    to.StepSecond(second, state, frames(*state.second()), Steps(x.tail(x.size() - first)), 1);
    return to;
  }
  double Energy(const Eigen::VectorXd& x) {
    Expansion there = mechanics.MakeExpansion();
    mechanics.points().Forget();
    mechanics.ExpandGradient(Stepped(x), there);
    return there.energy_mJ;
  }
  Eigen::VectorXd Gradient() const {
    Eigen::VectorXd gradient(unknowns());
    Eigen::Index k = 0;
    for (const Vector2d& g : at.gradient) gradient.segment<2>(2 * k++) = g;
    for (const Vector2d& g : at.second.front().gradient) gradient.segment<2>(2 * k++) = g;
    return gradient;
  }
};

inline const InstrumentPlaces kWireLeads{{15.1, 0.4}, {10.7, -0.8}};
inline const InstrumentPlaces kCatheterLeads{{9.9, 0.4}, {14.3, -0.8}};

}  // namespace torquer::test
