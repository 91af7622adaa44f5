// A wire that touches itself: balance of forces, invariance and refinement.
#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "host/simulator/core/internal_forces.h"
#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kLoopRigidity = 0.05;  // N mm^2
constexpr double kLoopWireMm = 0.2;     // radius

// A wire that rests as a loop of somewhat more than one turn. A force on its tip holds it on one
// side of its shaft during the feed. Then the force presses it on the shaft.
struct Loop {
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall{.points_per_segment = 2};
  EndForce force;
  std::vector<EnergyTerm*> terms{&force};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  static WireModel Wire(double torsional_ratio, double segment_mm, const Sheath& sheath) {
    return WireModel(segment_mm,
                     {{0, kLoopRigidity, kLoopWireMm, 0.1, 0, torsional_ratio * kLoopRigidity}}, 0,
                     90, BendingLaw::kExact, sheath);
  }
  Loop(double torsional_ratio, double segment_mm, const Vector3d& force_N,
       const Eigen::Matrix3d& turn = Eigen::Matrix3d::Identity(), bool touches = true)
      : stack({Wire(torsional_ratio, segment_mm, {.direction = turn * Vector3d::UnitX()})},
              {.touches_itself = touches, .stiffness_N_mm2 = 0.5}),
        force(-0.2 * turn * force_N),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, terms)),
        state(stack.empty_rod(), 1) {
    relaxation->Restart(state);
    // The hand turns the loop into the plane of the unturned one.
    const Vector3d plane = turn * SheathNormal(Vector3d::UnitX());
    const Vector3d direction = turn * Vector3d::UnitX();
    const Vector3d normal = SheathNormal(direction);
    const double turn_rad = std::atan2(plane.dot(direction.cross(normal)), plane.dot(normal));
    for (double fed_mm = 0; fed_mm <= 74; fed_mm += 2) {
      REQUIRE(Settle(*relaxation, {{fed_mm, turn_rad}}, state, 1000).converged);
    }
    force.SetForce(turn * force_N);
    REQUIRE(Settle(*relaxation, {{74, turn_rad}}, state, 1000).converged);
  }
  double PressedN() const { return relaxation->Current().between.front().pressed_N; }
};

// Across the plane of the loop, and somewhat towards its shaft.
Vector3d Press() {
  const Vector3d normal = SheathNormal(Vector3d::UnitX());
  return 1e-6 * Vector3d::UnitX().cross(normal) - 2e-7 * normal;
}

TEST_CASE("Contact of a wire with itself does not change the force and moment at its sheath") {
  const double torsional_ratio = GENERATE(0.0, 0.7);
  const bool touches = GENERATE(true, false);
  Loop loop(torsional_ratio, 1, Press(), Eigen::Matrix3d::Identity(), touches);
  if (touches) REQUIRE(loop.PressedN() > 2e-7);
  CAPTURE(touches);
  InternalForces forces;
  FindInternalForces(loop.relaxation->rods()[0], loop.state, loop.relaxation->Current(), loop.terms,
                     forces);
  const Vector3d moment_mJ = loop.state.tip().cross(Press());
  CAPTURE(torsional_ratio, forces.clamp_moment_mJ.transpose(), moment_mJ.transpose());
  CHECK((forces.clamp_moment_mJ + moment_mJ).norm() < 1e-5 * moment_mJ.norm());
}

TEST_CASE("A wire that touches itself lies alike in every direction of space") {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.1, Vector3d(0.3, -0.5, 0.8).normalized()).toRotationMatrix();
  Loop here(0, 1, Press());
  Loop turned(0, 1, Press(), turn);
  REQUIRE(here.state.segments() == turned.state.segments());
  for (std::size_t i = 0; i < here.state.nodes().size(); ++i) {
    CHECK((turn * here.state.nodes()[i] - turned.state.nodes()[i]).norm() < 1e-5);
  }
}

TEST_CASE("Finer segments change the contact of a wire with itself ever less") {
  std::vector<Vector3d> tips;
  for (const double segment_mm : {2.0, 1.0, 0.5}) {
    tips.push_back(Loop(0, segment_mm, Press()).state.tip());
  }
  const double coarse_mm = (tips[1] - tips[0]).norm();
  const double fine_mm = (tips[2] - tips[1]).norm();
  CAPTURE(coarse_mm, fine_mm);
  CHECK(fine_mm < 0.5 * coarse_mm);
  CHECK(fine_mm < 0.3);
  // Without the contact the wire passes through itself.
  Loop ghost(0, 1, Press(), Eigen::Matrix3d::Identity(), false);
  CHECK((ghost.state.tip() - tips[1]).norm() > 3 * fine_mm);
}

// A wire that rests as a hook leaves the mouth of a rigid, straight catheter and turns back. A
// force on its tip pulls it across the axis of the catheter.
struct Hook {
  static constexpr double kCatheterMm = 0.6;  // radius
  static constexpr double kMouthMm = 40;      // along the catheter
  static constexpr double kForce_N = 5e-4;
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall{.points_per_segment = 2};
  EndForce force{-kForce_N * SheathNormal(Vector3d::UnitX())};
  std::vector<EnergyTerm*> terms{&force};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  // Half a circle with a radius of 4 mm, and a straight end.
  static std::vector<WireModel> Wires(double ratio, double segment_mm) {
    const double wire = kLoopRigidity;
    const double catheter = 1e6;  // so it bends by 2 nm
    return {WireModel(segment_mm,
                      {{0, wire, kLoopWireMm, 0, 0, ratio * wire},
                       {8, wire, kLoopWireMm, 0, 0, ratio * wire},
                       {8.5, wire, kLoopWireMm, 0.25, 0, ratio * wire},
                       {20.5, wire, kLoopWireMm, 0.25, 0, ratio * wire},
                       {21, wire, kLoopWireMm, 0, 0, ratio * wire}},
                      0, 90, BendingLaw::kExact, {}),
            WireModel(segment_mm, {{0, catheter, kCatheterMm, 0, 0, ratio * catheter}}, 0, 90,
                      BendingLaw::kExact, {})};
  }
  Hook(double ratio, double segment_mm, bool touches)
      : stack(Wires(ratio, segment_mm), {.has_room = {false, true},
                                         .lumen_radius_mm = {0, kLoopWireMm + 0.05},
                                         .touches_itself = touches,
                                         .stiffness_N_mm2 = 0.5}),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, terms)),
        state(stack.empty_rod(), 2) {
    relaxation->Restart(state);
    for (double fed_mm = 0; fed_mm <= 22; fed_mm += 1) {
      REQUIRE(Settle(*relaxation, {{kMouthMm + fed_mm, 0}, {kMouthMm, 0}}, state, 5).converged);
    }
  }
  // Distance between the axis of the catheter and the wire that has turned back. The chords of the
  // wire, in small steps.
  double NearestMm() const {
    double nearest_mm = 1e9;
    const std::vector<Vector3d>& nodes = state.nodes();
    for (std::size_t i = nodes.size() / 2; i + 1 < nodes.size(); ++i) {
      if (nodes[i + 1][0] > nodes[i][0]) continue;
      for (double part = 0; part < 1; part += 0.01) {
        const Vector3d at = (1 - part) * nodes[i] + part * nodes[i + 1];
        if (at[0] < kMouthMm) nearest_mm = std::min(nearest_mm, std::hypot(at[1], at[2]));
      }
    }
    return nearest_mm;
  }
  // Force of the wire on the outside of the catheter.
  double OutsideN() const {
    for (const BetweenCurves& between : relaxation->Current().between) {
      if (!between.ordered && between.inner != between.outer) return between.pressed_N;
    }
    return 0;
  }
};

TEST_CASE("A wire that turns back comes to rest on the outside of its catheter") {
  const double ratio = GENERATE(0.0, 30.0);  // a softer wire twists and swings aside
  const double segment_mm = GENERATE(1.0, 0.5);
  const Hook hook(ratio, segment_mm, true);
  const Hook ghost(ratio, segment_mm, false);
  CAPTURE(ratio, segment_mm, hook.state.tip().transpose(), hook.OutsideN());
  CHECK(hook.OutsideN() > 5e-5);
  // The force indents by less than 1 um. A chord of an arc with curvature 0.16/mm lies beside it.
  const double chord_mm = 0.16 * segment_mm * segment_mm / 8;
  CHECK(hook.NearestMm() == Approx(kLoopWireMm + Hook::kCatheterMm).margin(chord_mm + 1e-3));
  CHECK(ghost.NearestMm() < 0.1);
}

}  // namespace
}  // namespace torquer::test
