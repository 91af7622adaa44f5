// Wire pulled at its tip, in a catheter so stiff that it keeps its round rest shape.
#pragma once

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/stack_terms.h"
#include "host/simulator/effects/contact/friction_between.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {

struct PulledWire {
  static constexpr double kRing = 30;
  static constexpr double kForce = 0.05;
  static constexpr double kRadius = 0.2;
  static constexpr double kGj = 0.4;
  static constexpr double kMu = 0.2;
  static constexpr double kInside = 60;

  struct Settings {
    double segment_mm = 1;
    double mu = kMu;
    int points_per_segment = 2;
    double room_mm = 0;          // 0: both lie on one curve
    double gj_N_mm2 = kGj;       // 0: nothing twists
    double stiffness_N_mm2 = 2;  // of the lumen
    bool in_sheath = false;      // both with clearance in a soft, short third one
  };

  InstrumentStack stack;
  FreeSpace field;
  WallModel wall;
  InstrumentPoses poses{{kInside + 10, 0}, {kInside, 0}};
  EndForce force{Vector3d::Zero()};
  effects::FrictionBetween friction;
  std::vector<EnergyTerm*> terms{&force, &friction};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;
  InternalForces forces;
  HandForces hands;

  static std::vector<WireModel> Both(const Settings& settings) {
    const bool twists = settings.gj_N_mm2 > 0;
    std::vector<WireModel> both;
    both.push_back(MakeWire({.segment_mm = settings.segment_mm,
                             .rigidity_N_mm2 = 1e-3,
                             .torsional_rigidity_N_mm2 = settings.gj_N_mm2,
                             .radius_mm = kRadius}));
    both.push_back(MakeWire({.segment_mm = settings.segment_mm,
                             .rigidity_N_mm2 = 2e4,
                             .torsional_rigidity_N_mm2 = twists ? 2e4 : 0,
                             .radius_mm = 0.5,
                             .tip_mm = 90,
                             .tip_curvature_1_per_mm = 1 / kRing}));
    if (settings.in_sheath) {
      both.push_back(MakeWire({.segment_mm = settings.segment_mm,
                               .rigidity_N_mm2 = 1e-4,
                               .torsional_rigidity_N_mm2 = twists ? 1e-4 : 0,
                               .radius_mm = 2}));
    }
    return both;
  }
  static Clearance Room(const Settings& settings) {
    if (settings.in_sheath) {
      return {
          .has_room = {false, false, true}, .lumen_radius_mm = {0, 0, 1}, .stiffness_N_mm2 = 0.01};
    }
    if (settings.room_mm == 0) return {};
    return {.has_room = {false, true},
            .lumen_radius_mm = {0, kRadius + settings.room_mm},
            .stiffness_N_mm2 = settings.stiffness_N_mm2};
  }
  effects::EffectContext Context() const {
    effects::EffectContext context{stack.empty_rod(), wall};
    context.instruments.resize(static_cast<std::size_t>(stack.size()));
    context.stack = &stack;
    return context;
  }
  // The slip length is much smaller than the turns.
  explicit PulledWire(const Settings& settings)
      : stack(Both(settings), Room(settings)),
        wall{.points_per_segment = settings.points_per_segment},
        friction(settings.mu, 1e-4, Context()),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {}, terms)),
        state(stack.empty_rod(), stack.size()) {
    if (settings.in_sheath) poses = {poses[0], poses[1], {5, 0}};
    force.SetForce(kForce * Towards(kInside / kRing));
    state = WireState::Along(stack.empty_rod(), {}, poses);
    relaxation->Restart(state);
    Go(0, 0);
    Go(0, 0);  // the mutual contact forces are known from here on
  }
  // Direction of the catheter where it has turned by an angle.
  Vector3d Towards(double angle_rad) const {
    return std::cos(angle_rad) * Vector3d::UnitX() +
           std::sin(angle_rad) * stack.empty_rod().sheath_normal();
  }
  void Go(double drawn_mm, double turned_rad, int steps = 1) {
    const InstrumentPose from = poses[0];
    for (int k = 1; k <= steps; ++k) {
      poses[0] = {from.insertion_mm + k * drawn_mm / steps,
                  from.rotation_rad + k * turned_rad / steps};
      REQUIRE(Settle(*relaxation, poses, state, 300).converged);
    }
  }
  // Force at the hand of the wire (0) or of the catheter (1).
  HandForce Hand(int instrument) {
    FindInternalForces(relaxation->rods()[0], state, relaxation->Current(), terms, forces);
    hands.Find(relaxation->rods(), state, relaxation->Current(), forces, friction.sliding());
    return hands.hands()[static_cast<std::size_t>(instrument)];
  }
  double HandTorque() const {
    return -TwistStiffnessOf(relaxation->rods()[0], state, 0, 0) * state.TwistOf(0, 0);
  }
  // Tension of the wire in N where it leaves the sheath.
  double TensionAtSheath() const {
    return -relaxation->Current().distal_gradient[0].dot(Vector3d::UnitX());
  }
  // Angle in rad of the wire's tip relative to the catheter.
  double TipTurn() const {
    if (&state.CurveOf(1) == &state) {
      const PerInstrument& turns = state.turns_rad().back();
      return turns[0] - turns[1];
    }
    const Curve& catheter = state.CurveOf(1);
    const Vector3d& around = catheter.tangents().back();
    const Vector3d outer =
        TurnedAbout(around, catheter.normals().back(), catheter.turns_rad().back()[1]);
    // The wire's segment that has the middle of the catheter's last one.
    std::size_t facing = 0;
    const Vector3d middle = (catheter.nodes().back() + catheter.nodes().end()[-2]) / 2;
    while ((state.nodes()[facing + 1] - middle).dot(around) < 0) ++facing;
    const Vector3d wire = TurnedAbout(state.tangents()[facing], state.normals()[facing],
                                      state.turns_rad()[facing][0]);
    return std::atan2(outer.cross(wire).dot(around), outer.dot(wire));
  }
};

}  // namespace torquer::test
