// Wire with clearance in a catheter, compared with beams on two supports.
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kWire_N_mm2 = 6.35e-3;
constexpr double kWireRadius_mm = 0.2;

WireModel Straight(double rigidity_N_mm2, double radius_mm, double segment_mm) {
  return WireModel(segment_mm, {{0, rigidity_N_mm2, radius_mm}}, 0, 120, BendingLaw::kExact, {});
}

// A wire in a catheter, in free space, with a force on the distal end.
struct Loose {
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall;
  EndForce force;
  std::vector<EnergyTerm*> terms{&force};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  Loose(std::vector<WireModel> instruments, double lumen_radius_mm, const Vector3d& force_N,
        int points_per_segment, double stiffness_N_mm2, double tolerance = 1e-9)
      : stack(std::move(instruments), {.has_room = {false, true},
                                       .lumen_radius_mm = {0, lumen_radius_mm},
                                       .stiffness_N_mm2 = stiffness_N_mm2}),
        wall{.points_per_segment = points_per_segment},
        force(force_N),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = tolerance}, terms)),
        state(stack.empty_rod(), 2) {
    relaxation->Restart(state);
  }
  int MoveTo(const InstrumentPoses& target) {
    int iterations = 0;
    TickReport report;
    for (int k = 0; k < 400; ++k) {
      CountedBudget budget(100000);
      report = relaxation->Tick(target, budget, state);
      iterations += report.iterations;
      if (report.converged && report.arrived()) break;
    }
    CAPTURE(report.residual, report.stalled, iterations);
    REQUIRE(report.converged);
    return iterations;
  }
};

// Deflection of a wire at the length b beyond the mouth of a rigid straight lumen. A force F pushes
// it sideways there. The wire has the length `inside` in the lumen and the clearance c on each
// side. It rests on the mouth's edge on one side. It touches the other side, parallel to the lumen,
// at the distance a behind the mouth.
double DeflectionBeyondMouth(double EI, double c, double inside, double b, double F) {
  const auto apart = [&](double a) {
    const double before = inside - a;  // clamped in the middle, and to the wall
    const double at_touch = 6 * EI * c / (before * before);
    return a * a * (2 * at_touch + F * b) / (6 * EI) - 2 * c;
  };
  double low = 0;
  double high = inside * 0.99;
  for (int k = 0; k < 100; ++k) {
    const double mid = (low + high) / 2;
    (apart(mid) < 0 ? low : high) = mid;
  }
  const double a = low;
  const double at_touch = 6 * EI * c / ((inside - a) * (inside - a));
  const double slope = a * (at_touch + F * b) / (2 * EI);
  return c + slope * b + F * b * b * b / (3 * EI);
}

TEST_CASE("Pushed across beyond a stiff catheter's mouth a wire turns in its room") {
  constexpr double kRoom_mm = 0.15;
  const double segment_mm = GENERATE(2.0, 1.0, 0.5, 0.25);
  const int points = GENERATE(1, 4);
  const double b = 10;
  const double F = 2e-6;
  Loose loose({Straight(kWire_N_mm2, kWireRadius_mm, segment_mm), Straight(1e3, 0.5, segment_mm)},
              kWireRadius_mm + kRoom_mm, {0, 0, F}, points, 100);
  const int iterations = loose.MoveTo({{60 + b, 0}, {60, 0}});
  const double expected = DeflectionBeyondMouth(kWire_N_mm2, kRoom_mm, 60, b, F);
  const double room_less = F * b * b * b / (3 * kWire_N_mm2);
  CAPTURE(segment_mm, points, iterations, expected, room_less);
  CHECK(loose.state.tip()[2] == Approx(expected).epsilon(0.01));
}

// Distance in mm between the equilibrium with this clearance and the one without clearance.
double ApartWithRoom(double room_mm, const InstrumentPoses& poses) {
  const auto bent = [](double rigidity_N_mm2, double radius_mm, double curvature) {
    return WireModel(1, {{0, rigidity_N_mm2, radius_mm, curvature}}, 0, 120, BendingLaw::kExact,
                     {});
  };
  const std::vector<WireModel> instruments = {bent(kWire_N_mm2, kWireRadius_mm, 0.02),
                                              bent(2 * kWire_N_mm2, 0.5, -0.01)};
  Loose loose(instruments, kWireRadius_mm + room_mm, {1e-6, 0, 3e-6}, 2, 1000);
  loose.MoveTo(poses);
  InstrumentStack stack(instruments);
  const FreeSpace field;
  const WallModel wall;
  EndForce force({1e-6, 0, 3e-6});
  const std::vector<EnergyTerm*> terms{&force};
  const auto relaxation = MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, terms);
  WireState state(stack.empty_rod(), 2);
  relaxation->Restart(state);
  REQUIRE(Settle(*relaxation, poses, state, 400).converged);
  return LargestDistance(loose.state.Farthest(), state);
}

TEST_CASE("Two curves with shrinking room approach one curve") {
  const InstrumentPoses poses =
      GENERATE(InstrumentPoses{{50, 0.4}, {37.3, -1}}, InstrumentPoses{{31.6, 0.4}, {50, -1}});
  const double wide_mm = ApartWithRoom(0.2, poses);
  const double half_mm = ApartWithRoom(0.1, poses);
  const double narrow_mm = ApartWithRoom(0.01, poses);
  CAPTURE(wide_mm, half_mm, narrow_mm);
  // Proportional to the root of the clearance: moments at tip ends decay over such a length.
  CHECK(half_mm == Approx(wide_mm / std::sqrt(2)).epsilon(0.1));
  CHECK(narrow_mm == Approx(half_mm / std::sqrt(10)).epsilon(0.1));
}

// A soft wire is pulled by T round an evenly bent, stiff lumen of radius R with the clearance c. It
// runs straight from the clamp to the inner side. There the lumen has turned by sqrt(2 c / R). From
// there on it lies at the inner side and presses with T / R per length.
TEST_CASE("Pulled round a bend a wire lies at the inner side of the lumen") {
  constexpr double kBend_mm = 40;
  constexpr double kRoom_mm = 0.3;
  const double segment_mm = GENERATE(1.0, 0.5);
  const double pull_N = 0.02;
  const WireModel wire(segment_mm, {{0, 1e-4, kWireRadius_mm}}, 0, 120, BendingLaw::kExact, {});
  // Curved towards its first normal, and so stiff that the wire does not bend it.
  const WireModel catheter(segment_mm, {{0, 1e4, 0.8, 1 / kBend_mm}}, 0, 120, BendingLaw::kExact,
                           {});
  const double angle = 1;
  const double inside_mm = kBend_mm * angle;
  const Vector3d& normal = catheter.sheath_normal();
  const Vector3d pull = pull_N * (std::cos(angle) * Vector3d::UnitX() + std::sin(angle) * normal);
  Loose loose({wire, catheter}, kWireRadius_mm + kRoom_mm, pull, 2, 100, 1e-7);
  loose.MoveTo({{inside_mm + 5, 0}, {inside_mm, 0}});
  const BetweenCurves& between = loose.relaxation->Current().between[0];
  CAPTURE(segment_mm, between.pressed_N, between.end_pressed_N, between.largest_offset_mm);
  const double pressed_N = pull_N * (angle - std::sqrt(2 * kRoom_mm / kBend_mm));
  CHECK(between.pressed_N == Approx(pressed_N).epsilon(0.015));
  CHECK(between.largest_offset_mm == Approx(kRoom_mm).epsilon(0.01));
  const Vector3d center = kBend_mm * normal;
  const auto& nodes = loose.state.nodes();
  const Vector3d& middle = nodes[nodes.size() / 2];
  CHECK((middle - center).norm() == Approx(kBend_mm - kRoom_mm).margin(0.02));
}

TEST_CASE("A force across on the catheter alone is borne by both") {
  // A soft catheter around a stiff wire of equal length. With negligible clearance the stiffnesses
  // add; with clearance the catheter bends alone until it touches.
  const double segment_mm = 1;
  Loose loose({Straight(100 * kWire_N_mm2, kWireRadius_mm, segment_mm),
               Straight(kWire_N_mm2, 0.5, segment_mm)},
              kWireRadius_mm + 0.3, {0, 0, 1e-6}, 2, 100);
  // The outer instrument leads, so the force acts on its end.
  loose.MoveTo({{30, 0}, {40, 0}});
  const double b = 40;
  const double alone_mm = 1e-6 * b * b * b / (3 * kWire_N_mm2);
  const double held_mm = 1e-6 * 1000.0 / (3 * kWire_N_mm2);
  CAPTURE(alone_mm, held_mm);
  CHECK(loose.state.curve(1).tip()[2] < alone_mm);
  CHECK(loose.state.curve(1).tip()[2] > held_mm);
}

// A beam on a bed of springs k buckles under the thrust 2 sqrt(k EI).
TEST_CASE("A thrust far beyond the buckling load of the lumen's wall does not break it") {
  constexpr double kStiffness_N_mm2 = 1;
  constexpr double kLumen_mm = 0.4;
  constexpr double kSoft_N_mm2 = 0.05;
  const double times = GENERATE(1.5, 4.0, 10.0);
  const double thrust_N = times * 2 * std::sqrt(kStiffness_N_mm2 * kSoft_N_mm2);
  const WireModel wire(0.5, {{0, kSoft_N_mm2, kWireRadius_mm}}, 0, 80, BendingLaw::kExact, {});
  const WireModel catheter(0.5, {{0, 1e4, 0.8}}, 0, 80, BendingLaw::kExact, {});
  const Vector3d axis = Sheath{}.direction;
  Loose loose({wire, catheter}, kLumen_mm, -thrust_N * axis + 1e-3 * axis.unitOrthogonal(), 2,
              kStiffness_N_mm2, 1e-6);
  loose.force.ActOn(0);
  if (GENERATE(true, false)) {
    // Thrust from the start: the wire crumples at the sheath.
    for (const double insertion_mm : {0.5, 2.0, 30.0}) loose.MoveTo({{insertion_mm, 0}, {40, 0}});
  } else {
    loose.force.SetForce(Vector3d::Zero());
    loose.MoveTo({{30, 0}, {40, 0}});
    loose.force.SetForce(-thrust_N * axis + 1e-3 * axis.unitOrthogonal());
    loose.MoveTo({{30.2, 0}, {40, 0}});
  }
  const Curve& inner = loose.state.curve(0);
  double offset_mm = 0;  // from the axis of the catheter, or from the sheath
  for (const Vector3d& node : inner.nodes()) {
    const Vector3d from = node - inner.nodes().front();
    offset_mm = std::max(offset_mm, (from - std::max(0.0, axis.dot(from)) * axis).norm());
  }
  CAPTURE(times, offset_mm);
  CHECK(offset_mm > kLumen_mm - kWireRadius_mm);
  CHECK(offset_mm < 2.1 * kLumen_mm - kWireRadius_mm);
}

}  // namespace
}  // namespace torquer::test
