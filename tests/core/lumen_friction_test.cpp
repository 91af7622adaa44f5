// Friction between a wire and a lumen with clearance.
#include "host/simulator/effects/contact/lumen_friction.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "host/simulator/core/newton/front_sweep.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/finite_differences.h"
#include "tests/support/pulled_wire.h"
#include "tests/support/sanitizer.h"
#include "tests/support/two_curves.h"

namespace torquer::test {
namespace {

// Two curves with friction, whose surfaces have slid against each other since the part's start.
struct Slid {
  TwoCurves curves;
  effects::FrictionBetween friction;

  effects::EffectContext Context() const {
    effects::EffectContext context{curves.model, curves.wall};
    context.instruments.resize(static_cast<std::size_t>(curves.stack.size()));
    context.stack = &curves.stack;
    return context;
  }
  void BuildModel() {
    curves.Forget();
    curves.mechanics.BuildModel(curves.state, curves.at);
  }
  using Marks = TwoCurves::Marks;
  Slid(const InstrumentPoses& poses, int points, double ratio, double slip_mm,
       const Marks& rooms = {false, true}, const Marks& beside = {})
      : curves(poses, points, 11, ratio, rooms, beside), friction(0.4, slip_mm, Context()) {
    curves.terms.push_back(&friction);
    curves.at = curves.mechanics.MakeQuadraticModel();
    curves.mechanics.PairCurves(curves.state);
    BuildModel();
    std::array<SurfaceMove, kMostInstruments> moves = {};
    moves[0] = {.along_mm = 0.01, .turn_rad = 0.03};
    moves[1] = {.along_mm = -0.004, .turn_rad = -0.01};
    for (int c = 0; c < curves.stack.curves(); ++c) {
      PointSet& points_of = curves.at.curve(c).points;
      // Forces that press two instruments on one curve against each other.
      if (ratio > 0) {
        points_of.between.pressed_N.assign(static_cast<std::size_t>(points_of.segments()),
                                           {1e-3, 2e-3, 3e-3, 0});
      }
      friction.Begin(points_of);
      friction.MoveSurfaces(points_of, moves);
    }
    Eigen::VectorXd x(curves.unknowns());
    std::mt19937 random(7);
    std::uniform_real_distribution<double> turn(-8e-4, 8e-4);
    for (double& component : x) component = turn(random);
    curves.state = curves.Stepped(x);
    BuildModel();
  }
};

TEST_CASE("Friction in a lumen has the gradient of finite differences") {
  const InstrumentPoses poses =
      GENERATE(kWireLeads, kCatheterLeads, kThreeWireLeads, kThreeCatheterLeads);
  const int points = GENERATE(1, 2, 4);
  const double ratio = GENERATE(0.0, 0.7);
  const double slip_mm = GENERATE(0.04, 0.003);  // sticks, slips
  if (kUnderSanitizer && points == 4) return;
  Slid slid(poses, points, ratio, slip_mm);
  const Eigen::VectorXd with = slid.curves.Gradient();
  const Eigen::VectorXd gradient =
      GradientOf([&](const Eigen::VectorXd& step) { return slid.curves.Energy(step); },
                 Eigen::VectorXd::Zero(slid.curves.unknowns()), 1e-5);
  CAPTURE(points, ratio, slip_mm, slid.curves.at.dissipated_mJ);
  CHECK((gradient - with).norm() < 2e-6 * gradient.norm());
  // Friction must contribute a substantial part of the gradient.
  slid.friction.Reset();
  slid.BuildModel();
  CHECK((slid.curves.Gradient() - with).norm() > 1e-3 * with.norm());
}

TEST_CASE("Friction between curves beside each other has the gradient of finite differences") {
  struct Layout {
    InstrumentPoses poses;
    TwoCurves::Marks rooms;
    TwoCurves::Marks beside;
  };
  const std::vector<Layout> layouts = {{kWireLeads, {}, {false, true}},
                                       {kCatheterLeads, {}, {false, true}},
                                       {kThreeWireLeads, {false, false, true}, {false, true}},
                                       {kThreeWireLeads, {false, true}, {false, false, true}}};
  const auto k = GENERATE(range(std::size_t{0}, std::size_t{4}));
  const double ratio = GENERATE(0.0, 0.7);
  const double slip_mm = GENERATE(0.04, 0.003);  // sticks, slips
  const Layout& layout = layouts[k];
  Slid slid(layout.poses, 2, ratio, slip_mm, layout.rooms, layout.beside);
  const auto of_beside = [&slid] {
    std::size_t slides = 0;
    for (const BetweenCurves& between : slid.curves.at.between) {
      if (between.beside) slides += between.slides.size();
    }
    return slides;
  };
  const Eigen::VectorXd with = slid.curves.Gradient();
  const Eigen::VectorXd gradient =
      GradientOf([&](const Eigen::VectorXd& step) { return slid.curves.Energy(step); },
                 Eigen::VectorXd::Zero(slid.curves.unknowns()), 1e-5);
  CAPTURE(k, ratio, slip_mm, of_beside(), slid.curves.at.dissipated_mJ);
  CHECK(of_beside() > 0);
  CHECK((gradient - with).norm() < 2e-6 * gradient.norm());
}

TEST_CASE("The sweep with friction in a lumen solves the dense system") {
  const InstrumentPoses poses = GENERATE(kWireLeads, kThreeCatheterLeads);
  const double ratio = GENERATE(0.0, 0.7);
  if (kUnderSanitizer) return;  // a dense Hessian takes a minute, and other tests slide there too
  Slid slid(poses, 2, ratio, 0.04);
  TwoCurves& curves = slid.curves;
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
  // The sweep leaves out the second derivatives of the sliding paths.
  const double apart = (swept() - dense).norm();
  CHECK(apart < 0.005 * dense.norm());
  // Without the coupling of spins, the step must differ.
  if (ratio == 0) return;
  for (BetweenCurves::SpinTerms& terms : curves.at.between[0].spin_terms) terms.any = false;
  CHECK((swept() - dense).norm() > 3 * apart);
}

// Capstan law: round a bend of the angle a the tension grows to F exp(mu a). With the clearance c,
// a wire runs straight from the clamp to the inner side. It reaches that side where the lumen has
// turned by sqrt(2 c / R).
TEST_CASE("Drawn through a lumen with room a wire follows the capstan law") {
  const double gj = GENERATE(0.0, PulledWire::kGj);
  const double mu = GENERATE(0.1, 0.3);
  const double segment_mm = GENERATE(1.0, 0.5);
  constexpr double kRoom_mm = 0.01;
  const double bound = 0.004 + 0.05 * mu;
  if (kUnderSanitizer && (segment_mm < 1 || mu < 0.3)) return;
  PulledWire wire({.segment_mm = segment_mm, .mu = mu, .room_mm = kRoom_mm, .gj_N_mm2 = gj});
  CHECK(wire.TensionAtSheath() == Approx(PulledWire::kForce).epsilon(0.004));
  const double angle =
      PulledWire::kInside / PulledWire::kRing - std::sqrt(2 * kRoom_mm / PulledWire::kRing);
  const double free_N = wire.TensionAtSheath();
  const double round_N = wire.Hand(1).axial_N;
  wire.Go(-0.5, 0, 5);
  CAPTURE(gj, mu, segment_mm);
  CHECK(wire.TensionAtSheath() == Approx(PulledWire::kForce * std::exp(mu * angle)).epsilon(bound));
  // The catheter's hand bears the friction, besides the force from its round shape in the sheath.
  const double more_N = wire.TensionAtSheath() - free_N;
  CHECK(wire.Hand(0).axial_N == Approx(-wire.TensionAtSheath()).epsilon(bound));
  CHECK(wire.Hand(1).axial_N - round_N == Approx(more_N).margin(bound * PulledWire::kForce));
  wire.Go(0.5, 0, 5);
  CHECK(wire.TensionAtSheath() ==
        Approx(PulledWire::kForce * std::exp(-mu * angle)).epsilon(bound));
}

// The closed form is that without clearance (stack_friction_test.cpp), with one difference. The
// wire climbs the lumen's side to the angle of friction. It presses with F/R, and the sine of that
// angle gives the friction across.
TEST_CASE("Turned in a lumen with room a wire follows the closed form of a torque lag") {
  const double segment_mm = GENERATE(2.0, 1.0);
  if (kUnderSanitizer && segment_mm < 2) return;
  CAPTURE(segment_mm);
  PulledWire wire({.segment_mm = segment_mm, .room_mm = 0.01});
  const double held = std::sin(std::atan(PulledWire::kMu)) * PulledWire::kForce *
                      PulledWire::kRadius / PulledWire::kRing;
  const double lag = held * PulledWire::kInside * PulledWire::kInside / (2 * PulledWire::kGj);
  const double bound = 0.01 + 0.03 * segment_mm;
  wire.Go(0, 2 * lag, 20);
  CHECK(wire.HandTorque() == Approx(held * PulledWire::kInside).epsilon(bound));
  CHECK(wire.TipTurn() == Approx(lag).epsilon(2 * bound));
  // Reversal: twice the torque over half the path (Masing rule).
  const double tip = wire.TipTurn();
  wire.Go(0, -0.8 * lag, 8);
  const double torque = std::sqrt(2 * PulledWire::kGj * held * 0.4 * lag);
  CHECK(wire.HandTorque() ==
        Approx(held * PulledWire::kInside - 2 * torque).margin(0.1 * held * PulledWire::kInside));
  CHECK(wire.TipTurn() == Approx(tip).epsilon(0.03));
}

TEST_CASE(
    "A wire that does not twist is held by friction all along where it is turned in a lumen") {
  const double way = GENERATE(1.0, -1.0);
  PulledWire wire({.room_mm = 0.01, .gj_N_mm2 = 0});
  const double before_mJ = wire.Hand(1).torque_mJ;
  wire.Go(0, way, 10);
  const double held_mJ = std::sin(std::atan(PulledWire::kMu)) * PulledWire::kForce *
                         PulledWire::kRadius / PulledWire::kRing * PulledWire::kInside;
  CHECK(wire.Hand(0).torque_mJ == Approx(way * held_mJ).epsilon(0.04));
  CHECK(wire.forces.twisting_mJ.front() == Approx(-wire.Hand(0).torque_mJ).epsilon(1e-6));
  // The catheter's hand feels the same torque with the opposite sign.
  CHECK(wire.Hand(1).torque_mJ - before_mJ == Approx(-way * held_mJ).epsilon(0.1));
  wire.Go(0, -way, 10);
  CHECK(wire.Hand(0).torque_mJ == Approx(-way * held_mJ).epsilon(0.04));
}

// At the contact the wire's surface slides to one side, so friction pushes the wire to the other.
TEST_CASE("A wire that is turned in a lumen climbs its side to the angle of friction") {
  const double way = GENERATE(1.0, -1.0);
  const double gj = GENERATE(0.0, PulledWire::kGj);
  PulledWire wire({.room_mm = 0.1, .gj_N_mm2 = gj});
  wire.Go(0, 2 * way, 20);
  const Vector3d center = PulledWire::kRing * wire.stack.empty_rod().sheath_normal();
  const Curve& lumen = wire.state.curve(1);
  const std::size_t middle = lumen.nodes().size() / 2;
  const Vector3d& tangent = lumen.tangents()[middle];
  const Vector3d inwards = (center - lumen.nodes()[middle]).normalized();
  const Vector3d off = wire.state.nodes()[middle] - lumen.nodes()[middle];
  CHECK(off.dot(inwards) > 0.09);
  CHECK(off.dot(tangent.cross(inwards)) / off.dot(inwards) ==
        Approx(-way * PulledWire::kMu).epsilon(0.05));
}

TEST_CASE("Surfaces turned by hands slide by their radii, lumen and wire in one direction") {
  const InstrumentStack stack(
      {MakeWire({}), MakeWire({.radius_mm = 0.6})},
      {.has_room = {false, true}, .lumen_radius_mm = {0, 0.5}, .stiffness_N_mm2 = 1});
  const WallModel wall;
  effects::EffectContext context{stack.empty_rod(), wall};
  context.stack = &stack;
  effects::LumenFriction friction(0.2, 0.01, context);
  PointSet points;
  points.per_segment = 1;
  points.position.resize(2);
  LumenContact contact;
  contact.outer = 1;
  contact.lever_mm = 0.2;
  contact.lumen_mm = 0.5;
  contact.force_N = 1;
  contact.offset_mm = {0.3, 0};
  points.between.lumen.assign(3, contact);
  const auto energy_mJ = [&] {
    PointDerivatives out;
    return friction.Add(points, out);
  };
  friction.Begin(points);
  REQUIRE(energy_mJ() == 0);
  std::array<SurfaceMove, kMostInstruments> moves = {};
  moves[0].turn_rad = 0.5;
  moves[1].turn_rad = 0.2;
  friction.MoveSurfaces(points, moves);
  CHECK(energy_mJ() == Approx(0).margin(1e-15));
  moves[0].turn_rad = -0.5;
  friction.MoveSurfaces(points, moves);
  CHECK(energy_mJ() > 1e-3);
}

TEST_CASE("Friction in a lumen holds without creep, and without a coefficient there is none") {
  PulledWire wire({.room_mm = 0.05});
  wire.Go(-0.2, 0.1, 4);
  const double tension_N = wire.TensionAtSheath();
  for (int k = 0; k < Rounds(500, 10); ++k) wire.Go(0, 0);
  CHECK(wire.TensionAtSheath() == Approx(tension_N).epsilon(1e-3));
  PulledWire free({.mu = 0, .room_mm = 0.05});
  free.Go(-0.2, 0.1, 4);
  CHECK(free.TensionAtSheath() == Approx(PulledWire::kForce).epsilon(0.02));
}

}  // namespace
}  // namespace torquer::test
