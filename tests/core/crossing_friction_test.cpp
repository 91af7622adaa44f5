// Friction of contacts that cross: of a wire with itself, and of wires that meet head on. Quadratic
// model, sweep and memory.
#include <Eigen/Dense>
#include <array>
#include <catch2/catch.hpp>
#include <memory>
#include <random>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction_between.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/crossing_curves.h"
#include "tests/support/finite_differences.h"
#include "tests/support/sanitizer.h"

namespace torquer::test {
namespace {

effects::EffectContext ContextOf(const InstrumentStack& stack, const WallModel& wall) {
  effects::EffectContext context{stack.empty_rod(), wall};
  context.instruments.resize(static_cast<std::size_t>(stack.size()));
  context.stack = &stack;
  return context;
}

// Curves with friction, whose surfaces have slid against each other since the part's start.
template <class Curves>
struct Rubbed {
  Curves curves;
  effects::FrictionBetween friction;

  template <class Settings>
  Rubbed(const Settings& settings, unsigned seed, double slip_mm)
      : curves(settings, seed), friction(0.4, slip_mm, ContextOf(curves.stack, curves.wall)) {
    curves.terms.push_back(&friction);
    curves.at = curves.mechanics.MakeQuadraticModel();
    curves.trial = curves.mechanics.MakeQuadraticModel();
    curves.Build();
    std::array<SurfaceMove, kMostInstruments> moves = {};
    moves[0].turn_rad = 0.03;
    moves[1].turn_rad = -0.01;
    for (int c = 0; c < curves.stack.curves(); ++c) {
      PointSet& points = curves.at.curve(c).points;
      if (curves.model.stack_twists()) {
        points.between.pressed_N.assign(static_cast<std::size_t>(points.segments()),
                                        {1e-3, 2e-3, 3e-3, 0});
      }
      friction.Begin(points);
      friction.MoveSurfaces(points, moves);
    }
    Eigen::VectorXd x(curves.unknowns());
    std::mt19937 random(7);
    std::uniform_real_distribution<double> turn(-8e-4, 8e-4);
    for (double& component : x) component = turn(random);
    curves.state = curves.Stepped(x);
    BuildModel();
  }
  void BuildModel() {
    curves.Forget();
    curves.mechanics.BuildModel(curves.state, curves.at);
  }
  std::size_t CrossingSlides() const {
    std::size_t slides = 0;
    for (const BetweenCurves& between : curves.at.between) {
      if (!between.ordered) slides += between.slides.size();
    }
    return slides;
  }
};

template <class Curves>
void CheckRubbedGradient(Rubbed<Curves>& rubbed) {
  CAPTURE(rubbed.CrossingSlides(), rubbed.curves.at.dissipated_mJ);
  REQUIRE(rubbed.CrossingSlides() > 3);
  const Eigen::VectorXd with = rubbed.curves.Gradient();
  const Eigen::VectorXd gradient =
      GradientOf([&](const Eigen::VectorXd& x) { return rubbed.curves.Energy(x); },
                 Eigen::VectorXd::Zero(rubbed.curves.unknowns()), 1e-5);
  CHECK((gradient - with).norm() < 2e-6 * gradient.norm());
  // Friction must contribute a substantial part of the gradient.
  rubbed.friction.Reset();
  rubbed.BuildModel();
  CHECK((rubbed.curves.Gradient() - with).norm() > 1e-2 * with.norm());
}

TEST_CASE("Friction of a wire with itself has the gradient of finite differences") {
  const auto settings = GENERATE(Coil::Settings{}, Coil::Settings{.curvature = 0.1},
                                 Coil::Settings{.ratio = 0.7, .curvature = 0.1},
                                 Coil::Settings{.instruments = 2, .ratio = 0.7},
                                 Coil::Settings{.instruments = 2, .curvature = 0.1});
  const double slip_mm = GENERATE(0.04, 0.003);  // sticks, slips
  Rubbed<Coil> rubbed(settings, 3, slip_mm);
  CAPTURE(settings.instruments, settings.ratio, settings.curvature, slip_mm);
  CheckRubbedGradient(rubbed);
}

TEST_CASE("Friction of wires that meet head on has the gradient of finite differences") {
  const double ratio = GENERATE(0.0, 0.7);
  const double slip_mm = GENERATE(0.04, 0.003);  // sticks, slips
  Rubbed<HeadOn> rubbed(ratio, 3, slip_mm);
  CAPTURE(ratio, slip_mm);
  CheckRubbedGradient(rubbed);
}

// Compares a step with that of the dense Newton system.
template <class Curves>
void CheckRubbedStep(Rubbed<Curves>& rubbed, double bound) {
  Curves& curves = rubbed.curves;
  Eigen::MatrixXd hessian = HessianOf([&](const Eigen::VectorXd& x) { return curves.Energy(x); },
                                      Eigen::VectorXd::Zero(curves.unknowns()), 1e-4);
  const Eigen::VectorXd unit = curves.Unit();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      hessian, Eigen::MatrixXd(unit.asDiagonal()));
  const double weight = 1 - eigen.eigenvalues()[0];
  hessian.diagonal() += weight * unit;
  const Eigen::VectorXd dense = -hessian.llt().solve(curves.Gradient());
  FrontSweep sweep = curves.Sweep();
  const auto swept = [&] {
    REQUIRE(sweep.Factor(curves.state, curves.at, weight));
    std::vector<CurveStep> steps(static_cast<std::size_t>(curves.stack.curves()));
    sweep.Step(curves.state, curves.at, steps);
    return curves.All(steps);
  };
  const double apart = (swept() - dense).norm();
  CAPTURE(apart / dense.norm());
  CHECK(apart < bound * dense.norm());
  // Without the coupling of spins, the step must differ.
  if (curves.model.spins() == 0) return;
  for (BetweenCurves& between : curves.at.between) {
    if (between.ordered) continue;
    for (BetweenCurves::SpinTerms& terms : between.spin_terms) terms.any = false;
  }
  CHECK((swept() - dense).norm() > 3 * apart);
}

TEST_CASE("The sweep with friction of a wire with itself solves the dense system") {
  const auto settings = GENERATE(Coil::Settings{}, Coil::Settings{.ratio = 0.7, .curvature = 0.1});
  if (kUnderSanitizer) return;  // a dense Hessian takes a minute
  unsigned seed = 3;
  while (!Coil(settings, seed).IsFarFromKinks()) ++seed;
  Rubbed<Coil> rubbed(settings, seed, 0.04);
  CAPTURE(settings.ratio, seed);
  // The sweep leaves out second derivatives by spins.
  CheckRubbedStep(rubbed, settings.ratio == 0 ? 1e-4 : 0.005);
}

TEST_CASE("The sweep with friction of wires that meet head on solves the dense system") {
  const double ratio = GENERATE(0.0, 0.7);
  if (kUnderSanitizer) return;
  unsigned seed = 3;
  while (!HeadOn(ratio, seed).IsFarFromKinks()) ++seed;
  Rubbed<HeadOn> rubbed(ratio, seed, 0.04);
  CAPTURE(ratio, seed);
  CheckRubbedStep(rubbed, ratio == 0 ? 1e-4 : 0.005);
}

// A wire that is fed into a ball, and winds up in it with friction.
struct RubbingBall {
  InstrumentStack stack;
  Ball field{Side::kInside, 6};
  WallModel wall{.stiffness_N_mm2 = 0.05, .points_per_segment = 2};
  effects::FrictionBetween friction;
  std::vector<EnergyTerm*> terms{&friction};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  explicit RubbingBall(double ratio)
      : stack({CoilWire(ratio, 0, {.point_mm = {-5.5, 0.5, 0.3}}, 1)},
              {.touches_itself = true, .stiffness_N_mm2 = 0.05}),
        friction(0.2, 0.005, ContextOf(stack, wall)),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-6}, terms)),
        state(stack.empty_rod(), 1) {
    relaxation->Restart(state);
  }
  TickReport Feed(int k, int iterations) {
    CountedBudget budget(iterations);
    return relaxation->Tick({{0.5 * k, 0.02 * k}}, budget, state);
  }
};

TEST_CASE("A wire that rubs on itself in a ball comes to rest, and takes no heap") {
  const double ratio = GENERATE(0.0, 0.7);
  RubbingBall ball(ratio);
  constexpr int kFeeds = kUnderSanitizer ? 60 : 150;
  const std::size_t allocated = AllocationCount();
  int converged = 0;
  double dissipated_mJ = 0;
  for (int k = 1; k <= kFeeds; ++k) {
    const TickReport report = ball.Feed(k, 1000);
    converged += report.converged;
    dissipated_mJ += report.dissipated_mJ;
  }
  CHECK(AllocationCount() == allocated);
  CHECK(converged == kFeeds);
  if (!kUnderSanitizer) CHECK(dissipated_mJ > 0);
}

TEST_CASE("A copy of a wire that rubs on itself goes on as the original") {
  RubbingBall a(0.7);
  RubbingBall b(0.7);
  const auto iterations = [](int k) { return 1 + k % 9; };
  constexpr int kCopied = 77;
  for (int k = 1; k <= kCopied; ++k) a.Feed(k, iterations(k));
  b.state = a.state;
  b.friction.CopyFrom(a.friction);
  b.relaxation->CopyFrom(*a.relaxation, b.state);
  for (int k = kCopied + 1; k <= 100; ++k) {
    a.Feed(k, iterations(k));
    b.Feed(k, iterations(k));
    REQUIRE(HashState(a.state) == HashState(b.state));
    REQUIRE(a.relaxation->Hash(0) == b.relaxation->Hash(0));
  }
}

}  // namespace
}  // namespace torquer::test
