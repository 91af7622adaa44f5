// Bent wire in a bent catheter with clearance.
#pragma once

#include <Eigen/Core>
#include <random>
#include <vector>

#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/dense_newton.h"
#include "tests/support/finite_differences.h"
#include "tests/support/twisted_stack.h"
#include "tests/support/wires.h"

namespace torquer::test {

// A bent wire in a bent catheter with clearance, both shaken, in the wall of a torus. Their tips
// are at any place within a segment.
struct TwoCurves {
  static constexpr double kSoftest = 6.35e-3;  // N mm^2
  Sheath sheath{Vector3d(21.8, 0, 0), Vector3d::UnitY()};
  InstrumentStack stack;
  const WireModel& model = stack.rod();
  const WireModel& second = *stack.second_rod();
  Torus field{Side::kInside, 20, 2};
  WallModel wall;
  EndForce force{Vector3d(1e-4, 2e-4, 3e-4)};
  std::vector<EnergyTerm*> terms{&force};  ///< more may be added before the first evaluation
  WireState state{model, stack.size()};
  WireMechanics mechanics;
  Expansion at;

  // `ratio` is GJ over EI; 0 means no twist. A third instrument lies on the catheter's curve.
  static std::vector<WireModel> Instruments(const Sheath& sheath, double ratio, int count) {
    std::vector<WireModel> all;
    all.push_back(Bent(kSoftest, ratio, 5.2, 0.1, 0, 0.2, sheath));
    all.push_back(Bent(2 * kSoftest, ratio, 4.1, 0.02, -0.03, 0.5, sheath));
    if (count > 2) all.push_back(Bent(3 * kSoftest, ratio, 3.1, -0.01, 0.02, 0.9, sheath));
    return all;
  }

  TwoCurves(const InstrumentPlaces& places, int points_per_segment, unsigned seed, double ratio = 0)
      : stack(Instruments(sheath, ratio, places.size()),
              {.first_outer = 1, .lumen_radius_mm = {0, 0.28, 0.6}, .stiffness_N_mm2 = 2e-3}),
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
    // Spins accumulate from the sheath on, as twists of either sign.
    for (const Part& part : {Part{model, state, 0}, Part{second, *state.second(), Own(0)}}) {
      for (int k = 0; k < part.model.spins(); ++k) {
        double sum = 0;
        for (int i = 0; i < part.curve.segments(); ++i) {
          sum += 0.2 - 0.15 * k + 5 * turn(random);
          x[part.first + (2 + part.model.spins()) * i + 2 + k] = sum;
        }
      }
    }
    state = Stepped(x);
    mechanics.Expand(state, at);
  }

  // A curve and its first unknown: for each segment a step, and a spin of each instrument.
  struct Part {
    const WireModel& model;
    const WireState& curve;
    Eigen::Index first;
  };
  // Number of unknowns of a curve; 0 is the first curve.
  Eigen::Index Own(int curve) const {
    return curve == 0 ? (2 + model.spins()) * state.segments()
                      : (2 + second.spins()) * state.second()->segments();
  }
  Eigen::Index unknowns() const { return Own(0) + Own(1); }
  // State after the unknowns x: first those of the first curve, then of the second.
  WireState Stepped(const Eigen::VectorXd& x) const {
    struct Moves {
      std::vector<Frame> frames;
      std::vector<Vector2d> xi;
      std::vector<double> spin;
    };
    const auto take = [&x](const Part& part) {
      Moves moves;
      const Eigen::Index each = 2 + part.model.spins();
      for (Eigen::Index i = 0; i < part.curve.segments(); ++i) {
        const auto k = static_cast<std::size_t>(i);
        moves.frames.push_back(TangentFrame(part.curve.tangents()[k], part.curve.normals()[k]));
        moves.xi.emplace_back(x.segment<2>(part.first + each * i));
        for (Eigen::Index m = 2; m < each; ++m) moves.spin.push_back(x[part.first + each * i + m]);
      }
      return moves;
    };
    const Moves of_first = take({model, state, 0});
    const Moves of_second = take({second, *state.second(), Own(0)});
    WireState to = state;
    to.Step(model, state, of_first.frames, of_first.xi, of_first.spin, 1);
    to.StepSecond(second, state, of_second.frames, of_second.xi, of_second.spin, 1);
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
    gradient << DenseGradient(model, state, at),
        DenseGradient(second, *state.second(), at.second.front());
    return gradient;
  }
};

inline const InstrumentPlaces kWireLeads{{15.1, 0.4}, {10.7, -0.8}};
inline const InstrumentPlaces kCatheterLeads{{9.9, 0.4}, {14.3, -0.8}};
// Two instruments on the outer curve.
inline const InstrumentPlaces kThreeWireLeads{{15.1, 0.4}, {10.7, -0.8}, {7.3, 0.5}};
inline const InstrumentPlaces kThreeCatheterLeads{{9.9, 0.4}, {14.3, -0.8}, {7.3, 0.5}};

}  // namespace torquer::test
