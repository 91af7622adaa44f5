// Friction between nested instruments that twist.
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "host/simulator/effects/contact/friction.h"
#include "host/simulator/effects/contact/friction_between.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/pulled_wire.h"
#include "tests/support/twisted_stack.h"

namespace torquer::test {
namespace {

TEST_CASE("A surface that reaches a point of another surface has not rolled there") {
  TwistedStack stack(2, 11);
  effects::EffectContext context{stack.model, stack.wall};
  context.instruments.resize(2);
  effects::Friction friction(0.3, 0.01, context);
  PointSet points = stack.at.points;
  friction.Begin(points);
  friction.End(points);
  friction.Begin(points);
  PointDerivatives out;
  const auto energy_mJ = [&] {
    out.used.assign(points.position.size(), PointDerivatives::kNothing);
    out.gradient.resize(points.position.size());
    return friction.Add(points, out);
  };
  REQUIRE(energy_mJ() < 1e-12);
  // The outer one is withdrawn beyond all points; otherwise it would have turned the surface.
  points.instruments.behind_mm[1] = 1e3;
  CHECK(energy_mJ() < 1e-12);
  points.instruments.behind_mm[1] = stack.at.points.instruments.behind_mm[1];
  for (auto& turns : points.instruments.angles_rad) turns[1] += 0.1;
  CHECK(energy_mJ() > 1e-6);
}

// A wire and a catheter, straight along the wall of a straight tube. Only the catheter touches. So
// only its motion feels friction. Beyond the slip length the energy is mu N (|s| - 3/8 d).
TEST_CASE("Friction holds the instrument that presses, wherever its tip is in a segment") {
  constexpr double kMu = 0.3;
  constexpr double kSlipMm = 0.01;
  constexpr double kWallPerMm = 2;  // N/mm^2
  const double tip_mm = GENERATE(10.0, 10.05, 10.1, 10.2, 10.3, 10.4, 10.6, 10.9);
  const int points = GENERATE(1, 2);
  CAPTURE(tip_mm, points);
  const Cylinder tube(Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), 3);
  const Sheath sheath{Vector3d(0, 2.7, 0), Vector3d::UnitX()};  // 0.3 mm from the wall
  const WallModel wall{.stiffness_N_mm2 = kWallPerMm, .points_per_segment = points};
  const InstrumentStack stack(
      {MakeWire({.radius_mm = 0.2, .max_length_mm = 40, .sheath = sheath}),
       MakeWire({.radius_mm = 0.5, .max_length_mm = 40, .sheath = sheath})});
  effects::EffectContext context{stack.empty_rod(), wall};
  context.instruments.resize(2);
  effects::Friction friction(kMu, kSlipMm, context);
  const std::vector<EnergyTerm*> terms{&friction};
  CombinedRods rods(stack);
  WireMechanics mechanics(rods, tube, wall, terms);
  QuadraticModel at = mechanics.MakeQuadraticModel();
  const auto go = [&](double wire_mm, double catheter_mm) {
    const InstrumentPoses poses{{wire_mm, 0}, {catheter_mm, 0}};
    rods.Combine(poses);
    mechanics.BuildModel(WireState::Along(rods[0], {}, poses), at);
    return at.dissipated_mJ;
  };
  go(20, tip_mm);
  const double pressed_N = kWallPerMm * 0.2 * (tip_mm - at.points.first_spacing_mm / 2);
  friction.End(at.points);
  friction.Begin(at.points);
  CHECK(go(20.7, tip_mm) < 1e-12);
  const double moved_mm = 0.04;
  CHECK(go(20, tip_mm + moved_mm) ==
        Approx(kMu * pressed_N * (moved_mm - 3.0 / 8 * kSlipMm)).epsilon(1e-6));
}

// Closed form of a torque lag. A wire drawn round the bend with the force F presses with F/R per
// length. Turned slowly, it feels the friction torque t = mu F r / R per length. Its twist
// decreases along the wire by t/GJ per length, to where the wire sticks. A turn by a twists the
// length sqrt(2 GJ a / t), and the hand feels sqrt(2 GJ t a). Beyond a turn of t L^2 / 2 GJ the
// whole wire slips. The hand feels t L, and the tip lags by that turn.
TEST_CASE(
    "Turned in a catheter against its friction, a wire follows the closed form of a torque lag") {
  const double segment_mm = GENERATE(2.0, 1.0, 0.5);
  const int points = GENERATE(1, 4);
  const bool in_sheath = GENERATE(false, true);  // with clearance for both
  if (in_sheath && (points > 1 || segment_mm > 1)) return;
  CAPTURE(segment_mm, points, in_sheath);
  PulledWire wire({.segment_mm = segment_mm, .points_per_segment = points, .in_sheath = in_sheath});
  const double held =
      PulledWire::kMu * PulledWire::kForce * PulledWire::kRadius / PulledWire::kRing;
  const double lag = held * PulledWire::kInside * PulledWire::kInside / (2 * PulledWire::kGj);
  const double bound = 0.01 + 0.03 * segment_mm;
  const auto torque = [&](double turned) { return std::sqrt(2 * PulledWire::kGj * held * turned); };

  wire.Go(0, 0.4 * lag, 8);
  CHECK(wire.HandTorque() == Approx(torque(0.4 * lag)).epsilon(bound));
  CHECK(std::abs(wire.TipTurn()) < 0.01 * lag);
  wire.Go(0, 2 * lag, 20);
  CHECK(wire.HandTorque() == Approx(held * PulledWire::kInside).epsilon(bound));
  CHECK(wire.TipTurn() == Approx(1.4 * lag).epsilon(bound));
  // Reversal after full slip: twice the torque over half the path (Masing rule).
  const double tip = wire.TipTurn();
  wire.Go(0, -0.8 * lag, 8);
  CHECK(wire.HandTorque() ==
        Approx(held * PulledWire::kInside - 2 * torque(0.4 * lag)).margin(2 * bound * torque(lag)));
  CHECK(wire.TipTurn() == Approx(tip).epsilon(0.01));
}

TEST_CASE("Friction that is held stays, tick after tick, and sticks where the wire is left") {
  PulledWire wire({});
  wire.Go(0, 0.3, 3);
  const double torque = wire.HandTorque();
  REQUIRE(torque > 1e-4);
  for (int k = 0; k < 2000; ++k) wire.Go(0, 0);
  CHECK(wire.HandTorque() == Approx(torque).epsilon(1e-3));
}

TEST_CASE(
    "A twisted wire that is drawn along loses its twist: friction has one cone for both "
    "directions") {
  PulledWire wire({});
  wire.Go(0, 1, 5);
  const double torque = wire.HandTorque();
  REQUIRE(torque > 1e-3);
  // Much longer than the path that the surface needs around the axis.
  wire.Go(-2, 0, 20);
  CHECK(std::abs(wire.HandTorque()) < 0.02 * torque);
  // During turning and withdrawal the surface moves around by r a over s: the torque has that
  // share.
  const double held = PulledWire::kMu * PulledWire::kForce * PulledWire::kRadius /
                      PulledWire::kRing * PulledWire::kInside;
  const double turned_a_mm = 5;
  wire.Go(-1, turned_a_mm, 50);
  const double around = PulledWire::kRadius * turned_a_mm;
  // Tension grows in the direction of withdrawal, by the capstan law.
  const double angle = PulledWire::kInside / PulledWire::kRing;
  const double mean = (std::exp(PulledWire::kMu * angle) - 1) / (PulledWire::kMu * angle);
  CHECK(wire.HandTorque() == Approx(mean * held * around / std::hypot(1, around)).epsilon(0.05));
}

TEST_CASE("Without a coefficient contact between instruments changes no shape") {
  const auto turned = [](double mu) {
    PulledWire wire({.mu = mu});
    wire.Go(-1, 2, 10);
    return wire.state;
  };
  const WireState none = turned(0);
  CHECK(std::abs(none.TwistOf(0, 0)) < 1e-9);
  CHECK(std::abs(turned(0.2).TwistOf(0, 0)) > 1e-4);
}

// Twisted stack with friction between its instruments, moved by hand.
struct Held {
  TwistedStack stack{3, 13};
  PointSet points = stack.at.points;
  effects::FrictionBetween friction{0.3, 0.01, Context()};

  Held() {
    points.between.pressed_N.assign(static_cast<std::size_t>(points.segments()),
                                    {1e-3, 2e-3, 3e-3, 0});
  }
  effects::EffectContext Context() const {
    effects::EffectContext context{stack.model, stack.wall};
    context.instruments.resize(3);
    context.stack = &stack.stack;
    return context;
  }
  double Energy() const {
    PointDerivatives out;
    return friction.Add(points, out);
  }
};

TEST_CASE("Instruments that come back out of the sheath hold each other as they lie then") {
  Held held;
  held.friction.Begin(held.points);
  held.friction.End(held.points);
  const PointSet whole = held.points;
  constexpr int kBack = 5;  // segments
  held.points.position.erase(held.points.position.begin(),
                             held.points.position.begin() + kBack * whole.per_segment);
  held.points.instruments.angles_rad.erase(held.points.instruments.angles_rad.begin(),
                                           held.points.instruments.angles_rad.begin() + kBack);
  held.friction.End(held.points);
  held.points = whole;
  for (int i = 0; i < kBack; ++i)
    held.points.instruments.angles_rad[static_cast<std::size_t>(i)][0] += 0.5;
  held.friction.Begin(held.points);
  CHECK(held.Energy() == 0);
  // Segments that stayed outside keep their anchors.
  held.points.instruments.angles_rad[kBack][0] += 0.5;
  CHECK(held.Energy() > 1e-7);
}

TEST_CASE("The hash of friction includes the direction of sliding") {
  Held held;
  const std::uint64_t before = held.friction.Hash(1);
  std::array<SurfaceMove, kMostInstruments> moves = {};
  moves[2].along_mm = 0.1;
  held.friction.MoveSurfaces(held.points, moves);
  const std::uint64_t forth = held.friction.Hash(1);
  CHECK(forth != before);
  moves[2].along_mm = -0.1;
  held.friction.MoveSurfaces(held.points, moves);
  CHECK(held.friction.Hash(1) != forth);
  held.friction.Reset();
  CHECK(held.friction.Hash(1) == before);
}

TEST_CASE("A torque between instruments has the derivatives of its energy") {
  TwistedStack stack(3, 13);
  effects::EffectContext context{stack.model, stack.wall};
  context.instruments.resize(3);
  context.stack = &stack.stack;
  const double slip_mm = GENERATE(0.01, 1.0);  // slipping, sticking
  effects::FrictionBetween friction(0.3, slip_mm, context);
  PointSet points = stack.at.points;
  points.between.pressed_N.assign(static_cast<std::size_t>(points.segments()),
                                  {1e-3, 2e-3, 3e-3, 0});
  friction.Begin(points);
  std::array<SurfaceMove, kMostInstruments> moves = {};
  moves[1].along_mm = 0.004;
  friction.MoveSurfaces(points, moves);
  const auto energy_mJ = [&](std::size_t segment, double inner, double outer) {
    PointSet there = points;
    there.instruments.angles_rad[segment][0] += 0.1 + inner;
    there.instruments.angles_rad[segment][1] += 0.03 + outer;
    PointDerivatives out;
    out.with_hessian = true;
    const double energy = friction.Add(there, out);
    return std::pair(energy, out.between);
  };
  // The first segments contain all three instruments, the last only the wire.
  for (const BetweenLoad& load : energy_mJ(1, 0, 0).second) {
    CHECK(load.segment * stack.model.segment_mm() < 11.3);
  }
  const double step = 1e-5;
  const auto load_of = [&](double inner) {
    for (const BetweenLoad& load : energy_mJ(1, inner, 0).second) {
      if (load.segment == 1 && load.inner == 0) return load;
    }
    FAIL("no load");
    return BetweenLoad{};
  };
  const BetweenLoad at = load_of(0);
  CHECK(at.outer == 1);
  const auto slope = [&](double inner, double outer) {
    return (energy_mJ(1, inner, outer).first - energy_mJ(1, -inner, -outer).first) / (2 * step);
  };
  CHECK(at.gradient == Approx(slope(step, 0)).epsilon(1e-6));
  // Friction acts on the middle instrument from inside and from outside.
  double middle = 0;
  for (const BetweenLoad& load : energy_mJ(1, 0, 0).second) {
    if (load.segment != 1) continue;
    middle += (load.inner == 1 ? load.gradient : 0) - (load.outer == 1 ? load.gradient : 0);
  }
  CHECK(middle == Approx(slope(0, step)).epsilon(1e-6));
  CHECK(at.hessian ==
        Approx((load_of(step).gradient - load_of(-step).gradient) / (2 * step)).epsilon(1e-4));
}

}  // namespace
}  // namespace torquer::test
