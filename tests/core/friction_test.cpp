#include "host/simulator/effects/contact/friction.h"

#include <catch2/catch.hpp>
#include <numbers>
#include <random>

#include "host/simulator/core/internal_forces.h"
#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/hand_forces.h"
#include "host/simulator/effects/contact/friction_between.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/finite_differences.h"
#include "tests/support/invariants.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wire_on_post.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// One point of a wire on a plane wall, moved by hand.
struct Slider {
  WireModel model = MakeWire({.segment_mm = 1, .max_length_mm = 3});
  WallModel wall{.stiffness_N_mm2 = 2, .points_per_segment = 1};
  effects::Friction friction;
  PointSet points;
  PointDerivatives derivatives;

  // A wire, and a catheter that may surround it.
  explicit Slider(double mu, double slip_mm) : friction(mu, slip_mm, Context()) {
    points = PressedPoint(0.05);
    points.stiffness_N_mm2 = {wall.stiffness_N_mm2};  // 2 N/mm^2, pressed with 0.1 N
    derivatives.with_hessian = true;
    derivatives.used = {0};
    derivatives.gradient.resize(1);
    derivatives.hessian.resize(1);
  }
  effects::EffectContext Context() const {
    effects::EffectContext context{model, wall};
    context.instruments = {{.name = "guidewire", .model = &model},
                           {.name = "catheter", .model = &model}};
    return context;
  }
  double Energy(const Vector3d& at) {
    points.position[0] = at;
    derivatives.used = {0};
    return friction.Add(points, derivatives);
  }
  void TickAt(const Vector3d& at) {
    friction.Begin(points);
    points.position[0] = at;
    friction.End(points);
  }
};

TEST_CASE("Friction's gradient and Hessian are those of its energy, sticking and slipping") {
  Slider slider(0.3, 0.01);
  slider.TickAt(Vector3d(1, 2, 0));  // creates the anchor
  slider.friction.Begin(slider.points);
  for (const Vector3d& offset :
       {Vector3d(0.002, 0.001, 0), Vector3d(-0.007, 0.004, 0.003), Vector3d(0.02, 0.01, -0.1),
        Vector3d(0.0001, 0, 5), Vector3d(-3, 1, 0)}) {
    const Vector3d at = Vector3d(1, 2, 0) + offset;
    slider.Energy(at);
    REQUIRE(slider.derivatives.used[0]);
    const Vector3d gradient = slider.derivatives.gradient[0];
    const Matrix3d hessian = slider.derivatives.hessian[0];
    const auto energy = [&](const Eigen::VectorXd& x) { return slider.Energy(x); };
    INFO("offset " << offset.transpose());
    CHECK((GradientOf(energy, at, 1e-5) - gradient).norm() < 1e-8);
    CHECK((HessianOf(energy, at, 2e-5) - hessian).norm() < 1e-4 * hessian.norm());
    CHECK(gradient.norm() <= 0.3 * 0.1 + 1e-12);
    CHECK(gradient[2] == 0);  // never along the wall's normal
  }
}

TEST_CASE("Energy, force and stiffness of friction go over evenly from stick to slip") {
  Slider slider(0.5, 0.02);
  slider.TickAt(Vector3d::Zero());
  slider.friction.Begin(slider.points);
  const double inside = slider.Energy(Vector3d(0.02 - 1e-9, 0, 0));
  const Vector3d g_inside = slider.derivatives.gradient[0];
  const Matrix3d h_inside = slider.derivatives.hessian[0];
  const double outside = slider.Energy(Vector3d(0.02 + 1e-9, 0, 0));
  CHECK(inside == Approx(outside).epsilon(1e-6));
  CHECK((g_inside - slider.derivatives.gradient[0]).norm() < 1e-7);
  CHECK((h_inside - slider.derivatives.hessian[0]).norm() < 1e-5 * h_inside.norm());
  CHECK(slider.derivatives.gradient[0].norm() == Approx(0.5 * 0.1));  // the Coulomb cone
}

TEST_CASE("An anchor stays while it sticks and follows at the slip length when it slips") {
  Slider slider(0.5, 0.02);
  slider.TickAt(Vector3d::Zero());
  slider.TickAt(Vector3d(0.019, 0, 0));
  slider.friction.Begin(slider.points);
  CHECK(slider.Energy(Vector3d::Zero()) == 0);  // still anchored at the origin
  slider.points.position[0] = Vector3d(1, 0, 0);
  slider.friction.End(slider.points);
  slider.friction.Begin(slider.points);
  CHECK(slider.Energy(Vector3d(0.98, 0, 0)) == Approx(0).margin(1e-15));
  // The point keeps the friction force that it had on arrival.
  slider.Energy(Vector3d(1, 0, 0));
  CHECK(slider.derivatives.gradient[0][0] == Approx(0.05));
}

TEST_CASE("A point that lifted off forgets its anchor") {
  Slider slider(0.5, 0.02);
  slider.TickAt(Vector3d::Zero());
  slider.points.touches[0] = 0;
  slider.friction.End(slider.points);
  slider.points.touches[0] = 1;
  slider.friction.Begin(slider.points);
  CHECK(slider.Energy(Vector3d(5, 0, 0)) == 0);
  CHECK_FALSE(slider.derivatives.used[0]);
}

TEST_CASE("Points that left through the sheath come back without an anchor") {
  Slider slider(0.5, 0.02);
  PointSet two = slider.points;
  two.position = {Vector3d(-1, 0, 0), Vector3d::Zero()};
  two.weight_mm = {1, 1};
  two.radius_mm = {0.178, 0.178};
  two.touches = {1, 1};
  two.near = {0, 1};
  two.clearance = {slider.points.clearance[0], slider.points.clearance[0]};
  two.stiffness_N_mm2 = {2, 2};
  slider.friction.End(two);
  slider.friction.Begin(two);
  slider.friction.End(slider.points);  // retracted: one point is left
  two.position = {Vector3d(7, 0, 0), Vector3d(8, 0, 0)};
  const auto energy = [&] {
    PointDerivatives out;
    out.used = {0, 0};
    out.gradient.resize(2);
    slider.friction.Add(two, out);
    return out.used[0];
  };
  // A point that is fed again has no friction in the tick of its return, nor in the next.
  slider.friction.Begin(slider.points);
  CHECK(energy() == 0);
  slider.friction.Begin(two);
  CHECK(energy() == 0);
}

// A straight, stiff wire on a plane floor; its clamp presses it onto the floor.
struct Sled {
  WireModel model;
  HalfSpace floor{Vector3d(0, 0, -1), Vector3d::UnitZ()};
  WallModel wall{.stiffness_N_mm2 = 10, .points_per_segment = 2};
  effects::Friction friction;
  EndForce force{Vector3d::Zero()};
  std::vector<EnergyTerm*> terms;
  NewtonRelaxation relaxation;
  WireState state;

  explicit Sled(double mu, double length_mm = 30)
      : model(MakeWire({.segment_mm = 1, .rigidity_N_mm2 = 0.5, .radius_mm = 0.2})),
        friction(mu, 0.005, {model, wall}),
        terms{&friction, &force},
        relaxation(model, floor, wall, {.tolerance = 1e-8}, terms),
        state(LayStraight(model, length_mm)) {
    relaxation.Restart(state);
  }
};

TEST_CASE("Below the cone the end of a wire sticks, above it slips") {
  Sled sled(0.4, 40);
  const double press = 0.01;
  sled.force.SetForce(Vector3d(0, 0, -press));
  for (int k = 0; k < 20; ++k) REQUIRE(Settle(sled.relaxation, {40, 0}, sled.state).converged);
  const double normal = [&] {
    double sum = 0;
    const PointSet& points = sled.relaxation.Current().points;
    for (int q = 0; q < points.size(); ++q) {
      const auto p = static_cast<std::size_t>(q);
      if (points.touches[p]) {
        sum += 10 * points.weight_mm[p] * (points.radius_mm[p] - points.clearance[p].clearance_mm);
      }
    }
    return sum;
  }();
  REQUIRE(normal > 0.5 * press);
  const Vector3d rest = sled.state.nodes().back();
  const auto pushed = [&](double part) {
    sled.force.SetForce(Vector3d(0, part * 0.4 * normal, -press));
    for (int k = 0; k < 200; ++k) Settle(sled.relaxation, {40, 0}, sled.state);
    return std::abs(sled.state.nodes().back()[1] - rest[1]);
  };
  CHECK(pushed(0.3) < 0.005);
  CHECK(pushed(0.6) < 0.005);
  CHECK(pushed(4) > 0.1);
}

TEST_CASE("A wire at rest does not creep in 1e5 ticks") {
  Sled sled(0.4, 30);
  // Pushed aside with half the limit of the friction cone, then left at rest.
  sled.force.SetForce(Vector3d(0, 0.15 * 0.01, -0.01));
  for (int k = 0; k < 50; ++k) REQUIRE(Settle(sled.relaxation, {30, 0}, sled.state).converged);
  const WireState before = sled.state;
  for (int k = 0; k < 100000; ++k) {
    CountedBudget budget(10);
    sled.relaxation.Tick({30, 0}, budget, sled.state);
  }
  CHECK(LargestDistance(before, sled.state) < 1e-6);
}

double Tension(const WireOnPost& on, double angle_rad) {
  const std::size_t i = on.NodeAt(angle_rad);
  return -on.relaxation.Current().distal_gradient[i].dot(on.state.tangents()[i]);
}

TEST_CASE("Tension of a wire drawn over a post grows by the capstan law, for any mesh and rows") {
  const double mu = GENERATE(0.1, 0.3);
  const int points_per_segment = GENERATE(1, 2, 8);
  const double row_mm = GENERATE(0.02, 0.2, 2.0);
  for (const double direction : {-1.0, 1.0}) {
    WireOnPost on({.mu = mu, .points_per_segment = points_per_segment});
    const int rows = static_cast<int>(std::lround(2 / row_mm));
    for (int k = 1; k <= rows; ++k) {
      const double insertion = 60 + direction * row_mm * k;
      REQUIRE(Settle(on.relaxation, {insertion, 0}, on.state).converged);
    }
    // Withdrawal makes the tension grow towards the sheath; feeding makes it fall.
    const double from = 2.0;
    const double to = 0.5;
    const double ratio = Tension(on, to) / Tension(on, from);
    INFO("mu " << mu << " direction " << direction << " ratio " << ratio);
    CHECK(ratio == Approx(std::exp(-direction * mu * (from - to))).epsilon(0.02));
    CHECK(std::abs(on.state.nodes().back()[2]) < 1e-3);
  }
}

TEST_CASE("With a coefficient of zero, and without the effect, a wire moves alike") {
  const Torus field(Side::kInside, 25, 3);
  const WireModel model = MakeWire({.tip_mm = 8,
                                    .tip_curvature_1_per_mm = 0.08,
                                    .sheath = {Vector3d(25, 0, 0), Vector3d::UnitY()}});
  const WallModel wall{.stiffness_N_mm2 = 0.02};
  effects::Friction friction(0, 0.005, {model, wall});
  const std::vector<EnergyTerm*> one{&friction};
  const std::vector<EnergyTerm*> none;
  NewtonRelaxation with(model, field, wall, {}, one);
  NewtonRelaxation without(model, field, wall, {}, none);
  WireState a(model);
  WireState b(model);
  with.Restart(a);
  without.Restart(b);
  for (int k = 1; k < 200; ++k) {
    CountedBudget first(50);
    CountedBudget second(50);
    with.Tick({0.2 * k, 0}, first, a);
    without.Tick({0.2 * k, 0}, second, b);
    REQUIRE(HashState(a) == HashState(b));
  }
}

TEST_CASE("Friction's memory is part of its hash, and Reset clears it") {
  Slider slider(0.5, 0.02);
  const std::uint64_t empty = slider.friction.Hash(1);
  slider.TickAt(Vector3d(1, 0, 0));
  const std::uint64_t one = slider.friction.Hash(1);
  CHECK(one != empty);
  slider.TickAt(Vector3d(2, 0, 0));
  CHECK(slider.friction.Hash(1) != one);
  slider.friction.Reset();
  CHECK(slider.friction.Hash(1) == empty);
}

TEST_CASE("A catheter that slides around the points takes their anchors along with its surface") {
  Slider slider(0.3, 0.01);
  slider.points.start = Vector3d(-1, 0, 0);  // the wire lies along x
  slider.points.instruments.last = 2;
  slider.TickAt(Vector3d::Zero());
  // The wire advances by 0.4 mm while the catheter around it rests: the wall sees no friction.
  const auto at = [&](double tip_mm, double catheter_mm) {
    slider.points.instruments.behind_mm = {0, tip_mm - catheter_mm};
    slider.points.start = Vector3d(tip_mm - 1, 0, 0);
    return slider.Energy(Vector3d(tip_mm, 0, 0));
  };
  slider.friction.Begin(slider.points);
  CHECK(at(0.4, 0) == Approx(0).margin(1e-15));
  // The catheter moves, with or without the wire.
  const double slid_mJ = 0.3 * 0.1 * (0.4 - 0.375 * 0.01);
  CHECK(at(0.4, 0.4) == Approx(slid_mJ));
  CHECK(at(0.7, 0.4) == Approx(slid_mJ));
}

TEST_CASE("A force between two places of a catheter is shared by the lever rule") {
  Slider slider(0.3, 0.01);
  PointSet& points = slider.points;
  // A wire of 3 mm presses at 1 mm, 0.3 mm behind a place of the catheter's surface.
  points.position = {Vector3d(1, 0, 0), Vector3d(2, 0, 0), Vector3d(3, 0, 0)};
  points.weight_mm = {1, 1, 0.5};
  points.radius_mm = {0.2, 0.2, 0.2};
  points.touches = {1, 0, 0};
  points.clearance.resize(3, points.clearance[0]);
  points.stiffness_N_mm2.resize(3, points.stiffness_N_mm2[0]);
  points.instruments.last = 2;
  points.instruments.behind_mm = {0, 0.7};
  slider.friction.Begin(points);
  slider.friction.End(points);
  slider.friction.Begin(points);
  // The whole stack advances by 1 mm. The places at 0.3 and 1.3 mm bear 0.3 and 0.7 of mu N.
  PointSet pushed = points;
  for (Vector3d& at : pushed.position) at[0] += 1;
  pushed.start[0] += 1;
  PointDerivatives out;
  out.with_hessian = true;
  out.used.assign(3, PointDerivatives::kNothing);
  out.gradient.resize(3);
  out.hessian.resize(3);
  slider.friction.Add(pushed, out);
  const double limit_N = 0.3 * 0.1;
  // The piece next to the sheath has the place at 0.3 mm. The next piece has the place at 1.3 mm.
  CHECK(out.gradient[0][0] == Approx(limit_N * (0.3 * 0.3 + 0.7 * 0.7)));
  CHECK(out.gradient[1][0] == Approx(limit_N * 0.7 * 0.3));
  CHECK(out.used[2] == PointDerivatives::kNothing);
}

TEST_CASE("An instrument that is turned while it slides shares one cone between both ways") {
  constexpr double kMu = 0.3;
  constexpr double kPress_N = 0.1;
  Slider slider(kMu, 0.01);
  slider.points.start = Vector3d(-1, 0, 0);  // along x, on a wall that faces +z
  const bool in_catheter = GENERATE(false, true);
  if (in_catheter) slider.points.instruments.last = 2;
  const double slid_mm = GENERATE(0.05, 1.0);
  const double turned_rad = GENERATE(-0.7, 0.0, 0.2, 3.0);
  slider.TickAt(Vector3d::Zero());
  std::array<SurfaceMove, kMostInstruments> moves = {};
  moves[in_catheter ? 1 : 0].turn_rad = turned_rad;
  moves[in_catheter ? 0 : 1].turn_rad = 5;  // not on the wall
  slider.friction.MoveSurfaces(slider.points, moves);
  slider.friction.Begin(slider.points);
  slider.Energy(Vector3d(slid_mm, 0, 0));
  // A right-handed turn moves the lowest point of a wire along x to +y; friction opposes it.
  const double round_mm = turned_rad * slider.points.radius_mm[0];
  const double way_mm = std::hypot(slid_mm, round_mm);
  const Vector3d on_wire_N = -slider.derivatives.gradient[0];
  CHECK(on_wire_N[0] == Approx(-kMu * kPress_N * slid_mm / way_mm));
  CHECK(on_wire_N[1] == Approx(-kMu * kPress_N * round_mm / way_mm).margin(1e-15));
  CHECK(on_wire_N[2] == 0);
}

TEST_CASE("The friction of a wire that twists is that of its surface, by finite differences") {
  const WireModel model = MakeWire({.segment_mm = 1,
                                    .rigidity_N_mm2 = 1e-2,
                                    .torsional_rigidity_N_mm2 = 8e-3,
                                    .tip_mm = 4,
                                    .tip_curvature_1_per_mm = 0.1,
                                    .sheath = {Vector3d(21.6, 0, 0), Vector3d::UnitY()}});
  const Torus field(Side::kInside, 20, 2);
  const WallModel wall{.stiffness_N_mm2 = 2e-2};
  // The slip length decides between slipping and sticking.
  effects::Friction friction(0.4, GENERATE(0.002, 0.1), {model, wall});
  const std::vector<EnergyTerm*> terms{&friction};
  WireMechanics mechanics(model, field, wall, terms);
  QuadraticModel at = mechanics.MakeQuadraticModel();
  std::mt19937 random(2);
  std::vector<Vector3d> arc;
  for (double a = 0.02; a < 1; a += 0.02) arc.emplace_back(22 * std::cos(a), 22 * std::sin(a), 0);
  WireState state = WireState::Along(model, arc, {12.2, 0});
  mechanics.BuildModel(state, at);
  REQUIRE(at.max_penetration_mm > 0.05);
  friction.Begin(at.points);
  friction.End(at.points);  // creates the anchors
  friction.Begin(at.points);
  const Eigen::Index unknowns = 3 * state.segments();
  std::uniform_real_distribution<double> step(-0.02, 0.02);
  Eigen::VectorXd moved(unknowns);
  for (Eigen::Index k = 0; k < unknowns; ++k) moved[k] = (k % 3 == 2 ? 5 : 0.2) * step(random);
  state = StepAndSpin(model, state, moved);
  mechanics.BuildModel(state, at);
  QuadraticModel there = mechanics.MakeQuadraticModel();
  const Eigen::VectorXd gradient = GradientOf(
      [&](const Eigen::VectorXd& x) {
        mechanics.points().Forget();
        mechanics.BuildGradient(StepAndSpin(model, state, x), there);
        return there.energy_mJ;
      },
      Eigen::VectorXd::Zero(unknowns), 1e-5);
  for (int i = 0; i < state.segments(); ++i) {
    INFO("segment " << i);
    CHECK((gradient.segment<2>(3 * i) - at.gradient[i]).norm() < 1e-6 * gradient.norm());
    CHECK(std::abs(gradient[3 * i + 2] - at.spin_gradient[i]) < 1e-6 * gradient.norm());
  }
}

TEST_CASE("A motion with friction in any budgets is the same to the bit, without heap") {
  const int seed = GENERATE(range(0, Rounds(12, 3)));
  CAPTURE(seed);
  const bool twists = seed % 2 == 1;
  const Torus torus(Side::kInside, 30, 3);
  const WallModel wall{.stiffness_N_mm2 = 0.05};
  std::vector<WireModel> instruments;
  for (int k = 0; k < 1 + seed % 3; ++k) {
    instruments.push_back(MakeWire({.segment_mm = seed % 4 < 2 ? 1 : 0.2,
                                    .rigidity_N_mm2 = 0.01 * (k + 1),
                                    .torsional_rigidity_N_mm2 = twists ? 0.02 : 0,
                                    .radius_mm = 0.2 + 0.3 * k,
                                    .tip_mm = 8,
                                    .tip_curvature_1_per_mm = 0.08,
                                    .max_length_mm = 50,
                                    .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}}));
  }
  // Each target takes one tick, or many small ones.
  const auto run = [&](bool cut) {
    std::mt19937 random(static_cast<unsigned>(seed));
    std::mt19937 random_units(5);
    InstrumentStack stack(instruments);
    effects::EffectContext context{stack.empty_rod(), wall};
    context.instruments.resize(instruments.size());
    context.stack = &stack;
    effects::Friction friction(0.2, 0.005, context);
    effects::FrictionBetween between(0.1, 0.005, context);
    const std::vector<EnergyTerm*> terms = {&friction, &between};
    const auto relaxation = MakeNewtonRelaxation(stack, torus, wall, NewtonSettings(), terms);
    WireState state(stack.empty_rod(), stack.size());
    relaxation->Restart(state);
    std::vector<std::uint64_t> hashes;
    hashes.reserve(3);
    const std::size_t allocated = AllocationCount();
    for (int round = 0; round < 3; ++round) {
      InstrumentPoses target(stack.size());
      for (InstrumentPose& pose : target) {
        pose = {std::uniform_real_distribution<double>(10, 50)(random),
                std::uniform_real_distribution<double>(-3, 3)(random)};
      }
      int done = 0;
      TickReport report;
      do {
        std::uniform_int_distribution<int> units(1, 9);
        CountedBudget budget(cut ? units(random_units) : 100000);
        report = relaxation->Tick(target, budget, state);
        done += report.work;
      } while (report.budget_spent && done < 100000);
      if (!report.arrived()) FAIL("did not arrive");
      hashes.push_back(relaxation->Hash(HashState(state)));
    }
    CHECK(AllocationCount() == allocated);
    return hashes;
  };
  CHECK(run(true) == run(false));
}

}  // namespace
}  // namespace torquer::test
