// Instruments beside each other: contact, friction and balance against closed forms.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/hand_forces.h"
#include "host/simulator/core/stack/stack_terms.h"
#include "host/simulator/effects/contact/friction_between.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kRadiusMm = 0.2;

// Two straight instruments that run along x in free space. One lies above the other and touches it.
// A force acts on the tip of the longer one.
struct SideBySide {
  struct Settings {
    double upper_N_mm2 = 5;
    double lower_N_mm2 = 5;
    double torsional_ratio = 0;
    double segment_mm = 1;
    bool upper_first = true;  // order in the stack
    double mu = 0;
    double gap_mm = 0;
    double stiffness_N_mm2 = 20;
  };
  const Settings settings;
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall{.points_per_segment = 2};
  EndForce force{Vector3d::Zero()};
  effects::FrictionBetween friction;
  std::vector<EnergyTerm*> terms{&force, &friction};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  static std::vector<WireModel> Both(const Settings& s) {
    const auto make = [&s](double rigidity_N_mm2, double height_mm) {
      const WireSection section{.rigidity_N_mm2 = rigidity_N_mm2,
                                .radius_mm = kRadiusMm,
                                .torsional_rigidity_N_mm2 = s.torsional_ratio * rigidity_N_mm2};
      return WireModel(s.segment_mm, {section}, 0, 120, BendingLaw::kExact,
                       {.point_mm = {0, 0, height_mm}});
    };
    std::vector<WireModel> both{make(s.upper_N_mm2, 2 * kRadiusMm + s.gap_mm),
                                make(s.lower_N_mm2, 0)};
    if (!s.upper_first) std::swap(both[0], both[1]);
    return both;
  }
  effects::EffectContext Context() const {
    effects::EffectContext context{stack.empty_rod(), wall};
    context.instruments.resize(2);
    context.stack = &stack;
    return context;
  }
  explicit SideBySide(const Settings& s)
      : settings(s),
        stack(Both(s), {.is_beside = {false, true}, .stiffness_N_mm2 = s.stiffness_N_mm2}),
        friction(s.mu, 1e-4, Context()),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, terms)),
        state(stack.empty_rod(), 2) {
    relaxation->Restart(state);
  }
  int upper() const { return settings.upper_first ? 0 : 1; }
  const Curve& Upper() const { return state.curve(upper()); }
  const Curve& Lower() const { return state.curve(1 - upper()); }
  void MoveTo(const InstrumentPose& upper_pose, const InstrumentPose& lower_pose) {
    InstrumentPoses poses(2);
    poses[upper()] = upper_pose;
    poses[1 - upper()] = lower_pose;
    REQUIRE(Settle(*relaxation, poses, state, 400).converged);
  }
  const BetweenCurves& Between() const { return relaxation->Current().between.front(); }
};

TEST_CASE("A beam pressed on a shorter one beside it shares its load by both rigidities") {
  const double upper_N_mm2 = GENERATE(5.0, 10.0);
  const double lower_N_mm2 = GENERATE(5.0, 20.0);
  const bool upper_first = GENERATE(true, false);
  const double segment_mm = GENERATE(1.0, 0.5);
  SideBySide pair({.upper_N_mm2 = upper_N_mm2,
                   .lower_N_mm2 = lower_N_mm2,
                   .segment_mm = segment_mm,
                   .upper_first = upper_first});
  constexpr double kLong = 60, kShort = 50, kForce = 2e-5;
  pair.MoveTo({kLong, 0}, {kShort, 0});
  pair.force.SetForce({0, 0, -kForce});
  pair.MoveTo({kLong, 0}, {kShort, 0});
  const double cube = kShort * kShort * kShort / 3;
  // Deflection of the free upper beam where the lower one ends.
  const double free_mm = kForce * kShort * kShort * (3 * kLong - kShort) / (6 * upper_N_mm2);
  const double contact_N = free_mm / (cube * (1 / upper_N_mm2 + 1 / lower_N_mm2));
  const double tip_mm = contact_N * cube / lower_N_mm2;
  CAPTURE(upper_N_mm2, lower_N_mm2, upper_first, segment_mm, tip_mm, contact_N);
  CHECK(pair.Between().pressed_N == Approx(contact_N).epsilon(0.03));
  CHECK(-pair.Lower().tip()[2] == Approx(tip_mm).epsilon(0.02));
}

TEST_CASE("Instruments that do not touch do not know of each other") {
  SideBySide pair({.gap_mm = 0.5});
  pair.force.SetForce({0, 0, 1e-5});
  pair.MoveTo({60, 0}, {50, 0});
  CHECK(pair.Between().pressed_N == 0);
  CHECK(pair.Lower().tip()[2] == Approx(0).margin(1e-12));
  CHECK(pair.Upper().tip()[2] - 0.9 == Approx(1e-5 * 216000 / 15).epsilon(1e-3));
}

TEST_CASE("A strong force drives no instrument through the one beside it in a step") {
  SideBySide pair({.upper_N_mm2 = 0.5, .gap_mm = 3});
  pair.MoveTo({60, 0}, {50, 0});
  pair.force.SetForce({0, 0, -0.2});
  const InstrumentPoses here = pair.state.poses();
  const auto apart = [&pair](int node) -> Vector3d {
    const auto k = static_cast<std::size_t>(node);
    return pair.Upper().nodes()[k] - pair.Lower().nodes()[k];
  };
  std::vector<Vector3d> before;
  for (int i = 1; i <= 45; ++i) before.push_back(apart(i));
  for (int iteration = 0; iteration < 40; ++iteration) {
    CountedBudget one(1);
    pair.relaxation->Tick(here, one, pair.state);
    for (int i = 1; i <= 45; ++i) {
      Vector3d& old = before[static_cast<std::size_t>(i) - 1];
      CAPTURE(iteration, i, old.transpose(), apart(i).transpose());
      CHECK(old.dot(apart(i)) > 0);
      old = apart(i);
    }
  }
}

// Two soft wires in free space; the second one lies across the first one, 2 to 4 mm above it. Then
// a force on the tip of the first one drives it against the second one.
struct AcrossTheWay {
  struct Settings {
    double rigidity_N_mm2;
    double lean;  // of the second wire along the first one
    double above_mm;
    Vector3d force_N;
  };
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall{.points_per_segment = 2};
  EndForce force{Vector3d::Zero()};
  std::vector<EnergyTerm*> terms{&force};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  static std::vector<WireModel> Both(const Settings& s) {
    const auto make = [&s](const Sheath& sheath) {
      return WireModel(1, {{.rigidity_N_mm2 = s.rigidity_N_mm2, .radius_mm = kRadiusMm}}, 0, 120,
                       BendingLaw::kExact, sheath);
    };
    const Vector3d across = Vector3d(s.lean, 1, 0).normalized();
    return {make({}),
            make({.point_mm = Vector3d(20, 0, s.above_mm) - 15 * across, .direction = across})};
  }
  explicit AcrossTheWay(const Settings& s)
      : stack(Both(s), {.is_beside = {false, true}, .stiffness_N_mm2 = 20}),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-6}, terms)),
        state(stack.empty_rod(), 2) {
    relaxation->Restart(state);
  }
};

// Least distance of the axes of two curves.
double ApartMm(const Curve& a, const Curve& b) {
  double least_mm = 1e9;
  for (std::size_t i = 0; i + 1 < a.nodes().size(); ++i) {
    for (double along = 0; along <= 1; along += 0.1) {
      const Vector3d at = (1 - along) * a.nodes()[i] + along * a.nodes()[i + 1];
      for (std::size_t m = 0; m + 1 < b.nodes().size(); ++m) {
        const Vector3d way = b.nodes()[m + 1] - b.nodes()[m];
        const double on = std::clamp((at - b.nodes()[m]).dot(way) / way.squaredNorm(), 0.0, 1.0);
        least_mm = std::min(least_mm, (at - b.nodes()[m] - on * way).norm());
      }
    }
  }
  return least_mm;
}

// Between two pairings, places that are not paired could pass through each other.
TEST_CASE("A strong force drives no instrument through one that lies across its way") {
  const AcrossTheWay::Settings settings =
      GENERATE(AcrossTheWay::Settings{0.006, -1, 2, {0, 3e-5, 1e-4}},
               AcrossTheWay::Settings{0.006, 0.4, 2, {0, 0, 1e-3}},
               AcrossTheWay::Settings{0.05, -1, 4, {0, 3e-4, 1e-3}});
  AcrossTheWay wires(settings);
  const InstrumentPoses here{{45, 0}, {30, 0}};
  REQUIRE(Settle(*wires.relaxation, here, wires.state, 400).converged);
  wires.force.SetForce(settings.force_N);
  for (int k = 0; k < 300; ++k) {
    CountedBudget one(1);
    if (wires.relaxation->Tick(here, one, wires.state).converged) break;
  }
  CAPTURE(settings.rigidity_N_mm2, settings.lean, settings.above_mm);
  CHECK(wires.state.curve(0).tip()[2] > settings.above_mm + 5);
  CHECK(ApartMm(wires.state.curve(0), wires.state.curve(1)) > 2 * kRadiusMm - 0.1);
}

// An instrument slides on another one with the force mu N, and both hands feel it.
TEST_CASE("Feeding along an instrument beside meets Coulomb friction at both hands") {
  const bool upper_first = GENERATE(true, false);
  constexpr double kMu = 0.3;
  // A softer one would slip off sideways.
  SideBySide pair({.upper_N_mm2 = 50, .lower_N_mm2 = 5e3, .upper_first = upper_first, .mu = kMu});
  pair.force.SetForce({0, 0, -2e-4});
  pair.MoveTo({20, 0}, {30, 0});
  // The force acts on the tip of the lower one until the upper one leads.
  pair.MoveTo({35, 0}, {30, 0});
  pair.MoveTo({36, 0}, {30, 0});
  // Friction takes the contact force at the start of a motion.
  pair.MoveTo({36.01, 0}, {30, 0});
  const double normal_N = pair.Between().pressed_N;
  REQUIRE(normal_N > 1e-4);
  InternalForces forces;
  HandForces hands;
  FindInternalForces(pair.relaxation->rods()[pair.state.FarthestCurve()], pair.state,
                     pair.relaxation->Current(), pair.terms, forces);
  hands.Find(pair.relaxation->rods(), pair.state, pair.relaxation->Current(), forces,
             pair.friction.sliding());
  const double on_upper_N = hands.hands()[static_cast<std::size_t>(pair.upper())].axial_N;
  const double on_lower_N = hands.hands()[static_cast<std::size_t>(1 - pair.upper())].axial_N;
  CAPTURE(upper_first, normal_N, on_upper_N, on_lower_N);
  CHECK(on_upper_N == Approx(kMu * normal_N).epsilon(0.03));
  CHECK(on_upper_N + on_lower_N == Approx(0).margin(0.03 * kMu * normal_N));
}

// An instrument that is turned rolls on the one below it, as a wheel on a road.
TEST_CASE("An instrument that turns rolls sideways on the one below it") {
  const bool upper_first = GENERATE(true, false);
  const double torsional_ratio = GENERATE(0.0, 10.0);
  SideBySide pair({.lower_N_mm2 = 5e3,
                   .torsional_ratio = torsional_ratio,
                   .upper_first = upper_first,
                   .mu = 1});
  pair.force.SetForce({0, 0, -2e-4});
  pair.MoveTo({21, 0}, {20, 0});
  pair.MoveTo({21, 0}, {20, 0});
  const double before_mm = pair.Upper().tip()[1];
  constexpr double kTurn = 0.1;
  pair.MoveTo({21, kTurn}, {20, 0});
  const double rolled_mm = pair.Upper().tip()[1] - before_mm;
  // The tangent is +x and the way up +z, so a right-handed turn rolls towards x cross z = -y.
  CAPTURE(upper_first, torsional_ratio, rolled_mm);
  CHECK(rolled_mm == Approx(-kTurn * kRadiusMm).epsilon(0.1));
}

}  // namespace
}  // namespace torquer::test
