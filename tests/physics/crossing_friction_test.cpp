// Friction of instruments that cross each other, and of one with itself, against closed forms.
#include <Eigen/Core>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction_between.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kCrossingRadiusMm = 0.2;
constexpr double kMu = 0.3;

// A straight instrument runs along x. Another one lies below it, at an angle, and crosses it 15 mm
// from the sheath of either. A force presses the tip of the upper one down.
struct Across {
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall{.points_per_segment = 2};
  EndForce force{Vector3d(0, 0, -2e-4)};
  effects::FrictionBetween friction;
  std::vector<EnergyTerm*> terms{&force, &friction};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;
  const bool upper_first;

  static std::vector<WireModel> Both(const Vector3d& lower_way, double torsional_ratio,
                                     bool upper_first) {
    const auto make = [&](double rigidity_N_mm2, const Sheath& sheath) {
      const WireSection section{.rigidity_N_mm2 = rigidity_N_mm2,
                                .radius_mm = kCrossingRadiusMm,
                                .torsional_rigidity_N_mm2 = torsional_ratio * rigidity_N_mm2};
      return WireModel(1, {section}, 0, 60, BendingLaw::kExact, sheath);
    };
    const Vector3d crossing(15.2, 0, 0);
    std::vector<WireModel> both{
        make(50, {.point_mm = {0, 0, 2 * kCrossingRadiusMm}}),
        make(5e3, {.point_mm = crossing - 15.3 * lower_way, .direction = lower_way})};
    if (!upper_first) std::swap(both[0], both[1]);
    return both;
  }
  effects::EffectContext Context() const {
    effects::EffectContext context{stack.empty_rod(), wall};
    context.instruments.resize(2);
    context.stack = &stack;
    return context;
  }
  Across(const Vector3d& lower_way, double torsional_ratio, bool first)
      : stack(Both(lower_way, torsional_ratio, first),
              {.is_beside = {false, true}, .stiffness_N_mm2 = 20}),
        friction(kMu, 1e-4, Context()),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, terms)),
        state(stack.empty_rod(), 2),
        upper_first(first) {
    force.ActOn(upper());
    relaxation->Restart(state);
    MoveTo({20, 0}, {22, 0});
  }
  int upper() const { return upper_first ? 0 : 1; }
  void MoveTo(const InstrumentPose& upper_pose, const InstrumentPose& lower_pose) {
    InstrumentPoses poses(2);
    poses[upper()] = upper_pose;
    poses[1 - upper()] = lower_pose;
    REQUIRE(Settle(*relaxation, poses, state, 400).converged);
  }
  double PressedN() const {
    double sum = 0;
    for (const BetweenCurves& between : relaxation->Current().between) sum += between.pressed_N;
    return sum;
  }
  // Force of the sheath of each on it, without the contact: minus all loads.
  Vector3d OnUpperN() const { return -SheathN(upper()) - Vector3d(0, 0, -2e-4); }
  Vector3d OnLowerN() const { return -SheathN(1 - upper()); }
  Vector3d SheathN(int curve) const {
    return relaxation->Current().curve(curve).distal_gradient.front();
  }
};

Vector3d LowerWay(double angle_deg) {
  const double angle = angle_deg * M_PI / 180;
  return {std::cos(angle), std::sin(angle), 0};
}

// Each is drawn along itself over the other one, to and fro.
TEST_CASE("Drawn across another one an instrument meets mu N, and the other one the opposite") {
  const double angle_deg = GENERATE(0.0, 30.0, 60.0, 90.0, 110.0, 135.0, 180.0);
  const double torsional_ratio = GENERATE(0.0, 0.7);
  const bool upper_first = GENERATE(true, false);
  const bool moves_upper = GENERATE(true, false);
  const double way = GENERATE(1.0, -1.0);
  const Vector3d lower_way = LowerWay(angle_deg);
  Across wires(lower_way, torsional_ratio, upper_first);
  const InstrumentPose upper{20, 0};
  const InstrumentPose lower{22, 0};
  const auto moved = [&](double by_mm) {
    InstrumentPose a = upper;
    InstrumentPose b = lower;
    (moves_upper ? a : b).insertion_mm += by_mm;
    wires.MoveTo(a, b);
  };
  moved(0.01 * way);
  moved(0.02 * way);
  const double normal_N = wires.PressedN();
  REQUIRE(normal_N > 1e-4);
  moved(0.03 * way);
  const Vector3d slides = moves_upper ? Vector3d::UnitX() : Vector3d(-lower_way);
  const Vector3d friction_N = -way * kMu * normal_N * slides;
  const auto in_plane = [](const Vector3d& force) { return Vector3d(force[0], force[1], 0); };
  CAPTURE(angle_deg, torsional_ratio, upper_first, moves_upper, way, normal_N,
          wires.OnUpperN().transpose(), friction_N.transpose());
  CHECK((in_plane(wires.OnUpperN()) - friction_N).norm() < 0.03 * friction_N.norm());
  CHECK((wires.OnUpperN() + wires.OnLowerN()).norm() < 1e-6 * normal_N);
}

TEST_CASE("Turned on another one an instrument rubs across itself, and pushes the other one") {
  const double angle_deg = GENERATE(60.0, 90.0, 135.0);
  const double torsional_ratio = GENERATE(0.0, 0.7);
  const bool upper_first = GENERATE(true, false);
  const Vector3d lower_way = LowerWay(angle_deg);
  Across wires(lower_way, torsional_ratio, upper_first);
  wires.MoveTo({20, 0.15}, {22, 0});
  const double normal_N = wires.PressedN();
  wires.MoveTo({20, 0.3}, {22, 0});
  // The lower side of the upper one moves to +y.
  const Vector3d friction_N(0, -kMu * normal_N, 0);
  CAPTURE(angle_deg, torsional_ratio, upper_first, wires.OnUpperN().transpose(),
          friction_N.transpose());
  CHECK(wires.OnUpperN()[1] == Approx(friction_N[1]).epsilon(0.03));
  CHECK((wires.OnUpperN() + wires.OnLowerN()).norm() < 1e-6 * normal_N);
}

// A soft wire over a thick one at a right angle, as over a post. Drawn at its sheath, it lifts a
// force on its tip.
struct OverAPost {
  static constexpr double kPostMm = 2;
  static constexpr double kForce = 0.05;
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall{.points_per_segment = 2};
  EndForce force{Vector3d::Zero()};
  effects::FrictionBetween friction;
  std::vector<EnergyTerm*> terms{&force, &friction};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  static std::vector<WireModel> Both() {
    constexpr double kSegmentMm = 0.25;
    const Vector3d post(10, -5, -kPostMm - kCrossingRadiusMm);
    return {WireModel(kSegmentMm, {{.rigidity_N_mm2 = 6e-4, .radius_mm = kCrossingRadiusMm}}, 0, 20,
                      BendingLaw::kExact, {}),
            WireModel(kSegmentMm, {{.rigidity_N_mm2 = 1e6, .radius_mm = kPostMm}}, 0, 20,
                      BendingLaw::kExact, {.point_mm = post, .direction = Vector3d::UnitY()})};
  }
  effects::EffectContext Context() const {
    effects::EffectContext context{stack.empty_rod(), wall};
    context.instruments.resize(2);
    context.stack = &stack;
    return context;
  }
  explicit OverAPost(double mu)
      : stack(Both(), {.is_beside = {false, true}, .stiffness_N_mm2 = 20}),
        friction(mu, 1e-3, Context()),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-7}, terms)),
        state(stack.empty_rod(), 2) {
    force.ActOn(0);
    relaxation->Restart(state);
    Go(17);
    force.SetForce({0, 0, -kForce});
    Go(17);
  }
  void Go(double inserted_mm) {
    REQUIRE(Settle(*relaxation, {{inserted_mm, 0}, {10, 0}}, state, 2000).converged);
  }
  double PullN() const { return -relaxation->Current().distal_gradient.front()[0]; }
};

TEST_CASE("Drawn over another wire at a right angle a wire follows the capstan law") {
  const double mu = GENERATE(0.1, 0.3);
  OverAPost wires(mu);
  // The contact slides by less than the axis, which lies farther from the middle of the bend.
  const double slides = OverAPost::kPostMm / (OverAPost::kPostMm + kCrossingRadiusMm);
  const double quarter = std::exp(mu * M_PI / 2 * slides);
  for (double mm = 16.9; mm > 16.05; mm -= 0.1) wires.Go(mm);
  CAPTURE(mu, wires.PullN(), wires.state.tip().transpose());
  CHECK(wires.PullN() == Approx(OverAPost::kForce * quarter).epsilon(0.015));
  for (double mm = 16.1; mm < 16.95; mm += 0.1) wires.Go(mm);
  CHECK(wires.PullN() == Approx(OverAPost::kForce / quarter).epsilon(0.015));
}

// Below the cone a contact that crosses holds, and nothing creeps.
TEST_CASE("A crossing contact holds an instrument below mu N, and lets it slip beyond") {
  const double angle_deg = GENERATE(90.0, 180.0);
  Across wires(LowerWay(angle_deg), 0, true);
  const double normal_N = wires.PressedN();
  const auto pushed = [&](double fraction) {
    wires.force.SetForce({0, fraction * kMu * normal_N, -2e-4});
    for (int k = 0; k < 20; ++k) wires.MoveTo({20, 0}, {22, 0});
    return wires.state.curve(0).tip()[1];
  };
  // The push acts on the tip, 4.8 mm beyond the contact; both bear it in part.
  const double before_mm = pushed(0);
  const double once_mm = pushed(0.3);
  const double again_mm = pushed(0.3);
  CAPTURE(angle_deg, before_mm, once_mm, again_mm);
  CHECK(again_mm - once_mm == Approx(0).margin(1e-6));
}

}  // namespace
}  // namespace torquer::test
