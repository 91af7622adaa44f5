// Contacts that cross: of a wire with itself, and of wires that meet head on. Quadratic model,
// sweep, memory and equilibrium.
#include <Eigen/Core>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "host/simulator/core/newton/move_instruments.h"
#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/crossing_curves.h"
#include "tests/support/sanitizer.h"

namespace torquer::test {
namespace {

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

TEST_CASE("The sweep of a wire that turns back on its catheter solves the dense Newton system") {
  const double ratio = GENERATE(0.0, 0.7);
  if (kUnderSanitizer) return;  // as above
  constexpr double kApartMm = kWireMm + TurnedBack::kCatheterMm - 0.06;
  unsigned seed = 3;
  while (!TurnedBack(ratio, kApartMm, seed).IsFarFromKinks()) ++seed;
  TurnedBack wires(ratio, kApartMm, seed);
  CAPTURE(ratio, seed);
  CHECK(wires.Outside().pressed_N > 0);
  CheckGradient(wires);
  CheckStep(wires, 10);
}

TEST_CASE("A wire touches the outside of its catheter where it comes near it, and nowhere else") {
  // The wire comes no nearer than a bow away from the mouth.
  const TurnedBack far(0, 2, 3);
  CHECK(far.Outside().pressed_N == 0);
  const TurnedBack near(0, kWireMm + TurnedBack::kCatheterMm - 0.06, 3);
  REQUIRE(near.Outside().pressed_N > 0);
  for (const BetweenCurves::Spring& spring : near.Outside().springs) {
    const SegmentPair& on = near.Outside().groups[static_cast<std::size_t>(spring.group)];
    CAPTURE(on.inner, on.outer);
    // The wire has turned back beyond x = 12 and runs against the catheter.
    CHECK(on.inner > 20);
    CHECK(on.outer < 6);
  }
}

TEST_CASE("Contact with the outside of a catheter fades over the last piece before its mouth") {
  constexpr double kCatheterMm = 4;  // the wire runs back along it from x = 5 to 2.2
  const TurnedBack wires(0, kWireMm + TurnedBack::kCatheterMm - 0.06, 3, kCatheterMm);
  const BetweenCurves& outside = wires.Outside();
  const Curve& catheter = wires.state.curve(1);
  constexpr double kPieceMm = 1.3 / 2;
  int whole = 0;
  int faded = 0;
  for (const BetweenCurves::Spring& spring : outside.springs) {
    const int m = outside.groups[static_cast<std::size_t>(spring.group)].outer;
    const double foot_mm =
        (m == 0 ? 0 : catheter.first_segment_mm() + 1.3 * (m - 1)) + spring.foot_mm;
    const double part = std::min(1.0, (kCatheterMm - foot_mm) / kPieceMm);
    CAPTURE(foot_mm, part);
    CHECK(part > 0);
    CHECK(spring.stiffness_N_mm == Approx(part * kPieceMm * 2e-3).epsilon(0.01));
    (part < 1 ? faded : whole) += 1;
  }
  CHECK(faded > 0);
  CHECK(whole > 0);
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

// A wire that winds to and fro over a straight one crosses it three times, each nearer to its
// sheath.
TEST_CASE("A wire that crosses another one again and again is paired with it each time") {
  constexpr double kAbove = 0.35;
  const double lean = GENERATE(-0.4, -0.2, 0.0, 0.2);  // of the crossings along the straight wire
  std::vector<Vector3d> way;
  Vector3d at(22, -5, kAbove);
  double heading = M_PI / 2 - lean;
  const auto go = [&](int steps, double turn_rad) {
    for (int k = 0; k < steps; ++k) {
      heading += turn_rad;
      way.push_back(at += 0.1 * Vector3d(std::cos(heading), std::sin(heading), 0));
    }
  };
  const Vector3d start = at;
  const Vector3d direction(std::cos(heading), std::sin(heading), 0);
  go(100, 0);
  go(60, (M_PI + 2 * lean) / 60);
  go(100, 0);
  go(60, -(M_PI - 2 * lean) / 60);
  go(100, 0);
  const std::vector<WireModel> wires = {CoilWire(0, 0, {start, direction}, 0.5),
                                        CoilWire(0, 0, {}, 0.5)};
  DenseCurves curves(wires, {.is_beside = {false, true}, .stiffness_N_mm2 = 2e-3}, NoVessel(),
                     {.stiffness_N_mm2 = 2e-3, .points_per_segment = 2});
  const InstrumentPoses poses{{41, 0}, {40, 0}};
  curves.rods.Combine(poses);
  curves.state = WireState::Along(curves.model, way, poses);
  LayCurves(curves.rods, curves.state);
  curves.state.curve(1) = [&] {
    WireState straight = WireState::Along(curves.rods[1], {}, {40, 0});
    return Curve(straight);
  }();
  curves.Build();
  std::vector<int> crossed;  // segments of the winding wire
  for (const BetweenCurves& between : curves.at.between) {
    for (const BetweenCurves::Spring& spring : between.springs) {
      if (spring.penetration_mm < 0.02) continue;
      const int segment = between.groups[static_cast<std::size_t>(spring.group)].inner;
      if (crossed.empty() || std::abs(crossed.back() - segment) > 3) crossed.push_back(segment);
    }
  }
  CAPTURE(lean, crossed);
  CHECK(crossed.size() == 3);
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
  WireState state{stack.empty_rod(), 1};

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
