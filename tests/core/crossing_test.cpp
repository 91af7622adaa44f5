// Contacts that cross: of a wire with itself, and of wires that meet head on. Quadratic model,
// sweep, memory and equilibrium.
#include <Eigen/Dense>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "host/simulator/core/newton/move_instruments.h"
#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/dense_curves.h"
#include "tests/support/sanitizer.h"

namespace torquer::test {
namespace {

constexpr double kWireMm = 0.2;  // radius

const FreeSpace& NoVessel() {
  static const FreeSpace field;
  return field;
}

WireModel CoilWire(double ratio, double curvature, const Sheath& sheath, double segment_mm) {
  const double rigidity = 6e-3;
  return WireModel(segment_mm, {{0, rigidity, kWireMm, curvature, 0, ratio * rigidity}}, 0, 120,
                   BendingLaw::kExact, sheath);
}

// Points of a coil around the z axis, from (radius, 0, 0) on.
std::vector<Vector3d> CoilPath(double radius_mm, double pitch_mm, double turns) {
  std::vector<Vector3d> path;
  for (double a = 0.02; a < 2 * M_PI * turns; a += 0.02) {
    path.emplace_back(radius_mm * std::cos(a), radius_mm * std::sin(a), pitch_mm * a / (2 * M_PI));
  }
  return path;
}

// Instruments on one curve, wound up so that each turn presses on the next one.
struct Coil : DenseCurves {
  struct Settings {
    int instruments = 1;
    double ratio = 0;  // GJ over EI; 0 means no twist
    double curvature = 0;
    double segment_mm = 1.3;
    double turns = 1.5;
  };
  static std::vector<WireModel> Wires(const Settings& s) {
    const Sheath sheath{Vector3d(3, 0, 0), Vector3d(0, 1, 0.02).normalized()};
    return std::vector<WireModel>(static_cast<std::size_t>(s.instruments),
                                  CoilWire(s.ratio, s.curvature, sheath, s.segment_mm));
  }

  Coil(const Settings& s, unsigned seed)
      : DenseCurves(Wires(s), {.touches_itself = true, .stiffness_N_mm2 = 2e-3}, NoVessel(),
                    {.stiffness_N_mm2 = 2e-3, .points_per_segment = 2}) {
    const double length_mm = 2 * M_PI * 3 * s.turns - 1;
    InstrumentPoses poses(s.instruments);
    for (int k = 0; k < s.instruments; ++k) poses[k] = {length_mm - 3.7 * k, 0.3 * k};
    stack.Combine(poses);
    mechanics.points().UpdateRadii();
    state = WireState::Along(model, CoilPath(3, 0.3, s.turns), poses);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> turn(-0.01, 0.01);
    Eigen::VectorXd x(unknowns());
    for (double& component : x) component = turn(random);
    state = Stepped(x);
    Build();
  }
};

TEST_CASE("The sweep of a wire that touches itself solves the dense Newton system") {
  const auto settings = GENERATE(Coil::Settings{}, Coil::Settings{.curvature = 0.1},
                                 Coil::Settings{.ratio = 0.7, .curvature = 0.1},
                                 Coil::Settings{.instruments = 2, .ratio = 0.7, .turns = 1.5},
                                 Coil::Settings{.instruments = 2, .curvature = 0.1});
  if (kUnderSanitizer && (settings.ratio == 0 || settings.instruments > 1)) return;
  unsigned seed = 3;
  while (!Coil(settings, seed).IsFarFromKinks()) ++seed;
  Coil coil(settings, seed);
  CAPTURE(settings.instruments, settings.ratio, settings.curvature, seed, coil.PressedN());
  CheckGradient(coil);
  CheckStep(coil, 10);
}

// Two wires beside each other; the second one turns back, and faces the first one head on.
struct HeadOn : DenseCurves {
  static constexpr double kApartMm = 0.34;
  static std::vector<WireModel> Wires(double ratio) {
    return {CoilWire(ratio, 0.02, {}, 1.3),
            CoilWire(ratio, 0, {.point_mm = {0, 3, 0}, .direction = {1, 0, 0}}, 1.3)};
  }
  // Straight on, and back on a circle of the radius `bow_mm` to the first wire.
  static std::vector<Vector3d> Way() {
    constexpr double kBowMm = (3 - kApartMm) / 2;
    std::vector<Vector3d> way;
    for (double x = 0.1; x < 14; x += 0.1) way.emplace_back(x, 3, 0);
    for (double a = 0.05; a < M_PI; a += 0.05) {
      way.emplace_back(14 + kBowMm * std::sin(a), 3 - kBowMm + kBowMm * std::cos(a), 0);
    }
    for (double x = 14; x > 1; x -= 0.1) way.emplace_back(x, kApartMm, 0);
    return way;
  }

  HeadOn(double ratio, unsigned seed)
      : DenseCurves(Wires(ratio),
                    {.is_beside = {false, true},
                     .start_path_mm = {std::vector<Vector3d>(), Way()},
                     .stiffness_N_mm2 = 2e-3},
                    NoVessel(), {.stiffness_N_mm2 = 2e-3, .points_per_segment = 2}) {
    const InstrumentPoses poses{{13.1, 0}, {26.4, 0.2}};
    stack.Combine(poses);
    state = WireState::Along(model, {}, poses);
    LayCurves(stack, state);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> turn(-0.01, 0.01);
    Eigen::VectorXd x(unknowns());
    for (double& component : x) component = turn(random);
    for (int c = 0; c < 2; ++c) mechanics.points(c).UpdateRadii();
    state = Stepped(x);
    Build();
  }
};

TEST_CASE("The sweep of wires that meet head on solves the dense Newton system") {
  const double ratio = GENERATE(0.0, 0.7);
  if (kUnderSanitizer) return;  // a dense Hessian takes a minute; the coil has the same code
  unsigned seed = 3;
  while (!HeadOn(ratio, seed).IsFarFromKinks()) ++seed;
  HeadOn wires(ratio, seed);
  double pressed_N = 0;
  for (const BetweenCurves& between : wires.at.between) {
    if (!between.ordered) pressed_N += between.pressed_N;
  }
  CAPTURE(ratio, seed);
  CHECK(pressed_N > 0);
  CheckGradient(wires);
  CheckStep(wires, 10);
}

TEST_CASE("With more contacts than rows, a step still gains what the sweep predicts") {
  // A turn of 60 segments, each in contact with the next turn.
  Coil coil({.segment_mm = 0.3, .turns = 3.2}, 3);
  constexpr double kWeight = 100;
  FrontSweep sweep = coil.Sweep();
  REQUIRE(sweep.Factor(coil.state, coil.at, kWeight));
  const std::vector<FrontOperation>& operations = sweep.schedule().operations();
  const auto count = [&](FrontOperation::Kind kind) {
    return std::count_if(operations.begin(), operations.end(),
                         [&](const FrontOperation& one) { return one.kind == kind; });
  };
  REQUIRE(count(FrontOperation::Kind::kEnd) > 10);
  REQUIRE(count(FrontOperation::Kind::kEnd) % 2 == 0);
  REQUIRE(count(FrontOperation::Kind::kOpen) == count(FrontOperation::Kind::kClose));
  std::vector<CurveStep> steps(1);
  const double predicted_mJ = sweep.Step(coil.state, coil.at, steps);
  const Eigen::VectorXd step = coil.All(steps);
  CHECK(predicted_mJ == Approx(-coil.Gradient().dot(step) / 2).epsilon(1e-9));
  // The true model, along the step.
  const double h = 1e-4 / step.lpNorm<Eigen::Infinity>();
  const double energy_mJ = coil.Energy(0 * step);
  const double bent_mJ =
      (coil.Energy(h * step) + coil.Energy(-h * step) - 2 * energy_mJ) / (h * h) +
      kWeight * step.dot(Eigen::VectorXd(coil.Unit().cwiseProduct(step)));
  CHECK(predicted_mJ > 0);
  CHECK(-coil.Gradient().dot(step) - bent_mJ / 2 > predicted_mJ * (1 - 1e-6));
}

// A wire that is fed into a ball, and winds up in it.
struct FilledBall {
  static constexpr double kBallMm = 6;
  InstrumentStack stack{{CoilWire(0, 0, {.point_mm = {-5.5, 0.5, 0.3}}, 1)},
                        {.touches_itself = true, .stiffness_N_mm2 = 0.05}};
  Ball field{Side::kInside, kBallMm};
  WallModel wall{.stiffness_N_mm2 = 0.05, .points_per_segment = 2};
  std::vector<EnergyTerm*> none;
  std::unique_ptr<Relaxation> relaxation =
      MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-6}, none);
  WireState state{stack.rod(), 1};

  FilledBall() { relaxation->Restart(state); }
};

// Least distance of the axes of segments that are far from each other along the wire.
double NearestMm(const Curve& curve) {
  double nearest_mm = 1e9;
  const std::vector<Vector3d>& nodes = curve.nodes();
  for (std::size_t i = 0; i + 5 < nodes.size(); ++i) {
    for (std::size_t m = i + 4; m + 1 < nodes.size(); ++m) {
      for (double a = 0; a <= 1; a += 0.1) {
        const Vector3d at = (1 - a) * nodes[i] + a * nodes[i + 1];
        const Vector3d along = nodes[m + 1] - nodes[m];
        const double b = std::clamp((at - nodes[m]).dot(along) / along.squaredNorm(), 0.0, 1.0);
        nearest_mm = std::min(nearest_mm, (at - nodes[m] - b * along).norm());
      }
    }
  }
  return nearest_mm;
}

TEST_CASE("A wire that fills a ball comes to rest around itself, and takes no heap") {
  FilledBall ball;
  constexpr int kFeeds = kUnderSanitizer ? 60 : 220;
  double nearest_mm = 1e9;
  const std::size_t allocated = AllocationCount();
  int converged = 0;
  for (int k = 1; k <= kFeeds; ++k) {
    CountedBudget budget(400);
    converged += ball.relaxation->Tick({{0.5 * k, 0}}, budget, ball.state).converged;
    if (k % 20 == 0) nearest_mm = std::min(nearest_mm, NearestMm(ball.state));
  }
  CHECK(AllocationCount() == allocated);
  CHECK(converged == kFeeds);
  CAPTURE(nearest_mm);
  CHECK(nearest_mm > 2 * kWireMm - 0.03);
  if (!kUnderSanitizer) CHECK(ball.relaxation->Current().between.front().pressed_N > 2e-5);
}

TEST_CASE("A copy of a wire that touches itself continues like the original") {
  FilledBall a;
  const auto tick = [](FilledBall& ball, int k) {
    CountedBudget budget(1 + k % 9);
    ball.relaxation->Tick({{0.5 * k, 0.05 * k}}, budget, ball.state);
  };
  const int copied = GENERATE(31, 77);
  for (int k = 1; k <= copied; ++k) tick(a, k);
  FilledBall b;
  b.state = a.state;
  b.relaxation->CopyFrom(*a.relaxation, b.state);
  for (int k = copied + 1; k <= 100; ++k) {
    tick(a, k);
    tick(b, k);
    REQUIRE(HashState(a.state) == HashState(b.state));
    REQUIRE(a.relaxation->Hash(0) == b.relaxation->Hash(0));
  }
}

TEST_CASE("Contact with itself without stiffness is refused") {
  const auto make = [](double stiffness_N_mm2) {
    return InstrumentStack({CoilWire(0, 0, {}, 1)},
                           {.touches_itself = true, .stiffness_N_mm2 = stiffness_N_mm2});
  };
  CHECK_NOTHROW(make(1e-3));
  CHECK_THROWS_WITH(make(0), Catch::Contains("stiffness"));
}

}  // namespace
}  // namespace torquer::test
