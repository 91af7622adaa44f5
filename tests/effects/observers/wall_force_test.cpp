#include "host/simulator/effects/observers/wall_force.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

double ReadingOf(const effects::Observer& observer, const std::string& name) {
  for (const effects::Reading& reading : observer.Readings()) {
    if (reading.name == name) return reading.value;
  }
  FAIL("no reading " << name);
  return 0;
}

TEST_CASE("A wire across a slit presses on the wall with the beam's force") {
  // A wire clamped in the middle of a slit, bent to its wall by its own rest curvature. It is a
  // cantilever of length L with its end held back. At the tip, P L^3 / (3 EI) is the free
  // deflection minus the held deflection.
  const double length = 30;
  const double rigidity = 6.35e-3;
  const double curvature = 0.004;
  const double half_gap = 0.8;
  const WireModel model = MakeWire({.segment_mm = 0.5,
                                    .rigidity_N_mm2 = rigidity,
                                    .tip_mm = length,
                                    .tip_curvature_1_per_mm = curvature,
                                    .max_length_mm = length});
  const Cylinder field(Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), half_gap);
  const WallModel wall{.stiffness_N_mm2 = 10, .points_per_segment = 2};
  const std::vector<EnergyTerm*> none;
  NewtonRelaxation relaxation(model, field, wall, {.tolerance = 1e-9}, none);
  WireState state = LayStraight(model, length);
  relaxation.Restart(state);
  CountedBudget budget(100000);
  const InstrumentPoses target{length, 0};
  const TickReport report = relaxation.Tick(target, budget, state);
  REQUIRE(report.converged);

  effects::WallForce force({.threshold_mN = 1e-4, .tip_mm = 5});
  const effects::Controls controls;
  const effects::TickView tick{.time_s = 0.5,
                               .step_s = 0.5,
                               .controls = controls,
                               .target = target,
                               .state = state,
                               .quadratic = relaxation.Current(),
                               .report = report};
  force.Observe(tick);
  const double held = half_gap - model.radius_mm(0);
  const double free = curvature * length * length / 2;
  const double expected_mN = 1e3 * 3 * rigidity * (free - held) / (length * length * length);
  CHECK(force.sum_mN() == Approx(expected_mN).epsilon(0.03));
  // The whole force is near the tip, the only place of contact.
  CHECK(force.tip_mN() == Approx(force.sum_mN()));
  // The contact lasts half a second in two halves; it stays above the threshold, so it is one
  // event.
  CHECK(force.impulse_mNs() == Approx(0.5 * expected_mN).epsilon(0.03));
  force.Observe(tick);
  CHECK(force.impulse_mNs() == Approx(expected_mN).epsilon(0.03));
  CHECK(force.events() == 1);
  CHECK(force.seconds_above() == 1);
  force.Restart();
  CHECK(std::isnan(force.largest_ever_mN()));
  CHECK(std::isnan(force.impulse_mNs()));
}

// Vessel with a part of its wall moved outwards.
class MovedWall final : public AnalyticField {
 public:
  using Part = std::function<bool(const Vector3d&)>;
  MovedWall(const AnalyticField& field, Part part, double outwards_mm)
      : field_(field), part_(std::move(part)), outwards_mm_(outwards_mm) {}
  void EvaluateHessian(const Vector3d& at, ClearanceSample& out) const override {
    field_.EvaluateHessian(at, out);
    if (part_(at)) out.clearance_mm += outwards_mm_;
  }

 private:
  const AnalyticField& field_;
  const Part part_;
  const double outwards_mm_;
};

// A wire at rest in a ring, touching its outer wall at many points.
struct InRing {
  static constexpr double kLengthMm = 70;
  static constexpr double kTipMm = 9;
  const Torus ring{Side::kInside, 30, 0.4};
  const WireModel model =
      MakeWire({.max_length_mm = 80, .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}});
  const WallModel wall{.stiffness_N_mm2 = 2e-4, .points_per_segment = 2};
  const std::vector<EnergyTerm*> none;

  // Relaxes the wire on a wall and returns its energy; `force`, if given, observes the result.
  double Rest(const ClearanceField& field, WireState& state, effects::WallForce* force) const {
    NewtonRelaxation relaxation(model, field, wall, {.tolerance = 1e-11}, none);
    relaxation.Restart(state);
    const InstrumentPoses target{kLengthMm, 0};
    const TickReport report = Settle(relaxation, target, state);
    if (force != nullptr) {
      const effects::Controls controls;
      force->Observe({.time_s = 1,
                      .step_s = 1,
                      .controls = controls,
                      .target = target,
                      .state = state,
                      .quadratic = relaxation.Current(),
                      .report = report});
    }
    return relaxation.Current().energy_mJ;
  }
};

TEST_CASE("Wall forces are what the energy changes by when that part of the wall gives way") {
  const InRing at;
  WireState state(at.model);
  const double lambda = at.model.segment_mm();
  // A point carries the range between the middles of adjacent pieces; this length ends at such a
  // middle.
  const double tip_mm = InRing::kTipMm + lambda / 4;
  effects::WallForce force({.threshold_mN = 1e-6, .tip_mm = tip_mm, .patch_mm = 2});
  at.Rest(at.ring, state, &force);
  const int n = state.segments();
  // The angle along the ring identifies each point of the wire.
  const auto angle = [](const Vector3d& p) { return std::atan2(p[1], p[0]); };
  const auto at_length = [&](double from_tip_mm) {
    const double segments = from_tip_mm / lambda;
    const int behind = std::clamp(static_cast<int>(segments), 0, n - 1);
    const auto i = static_cast<std::size_t>(n - 1 - behind);
    return Vector3d(state.nodes()[i + 1] - (from_tip_mm - lambda * behind) * state.tangents()[i]);
  };
  // Force in mN on a part of the wall. At equilibrium only the wall's displacement changes the
  // energy.
  const auto carried_mN = [&](const MovedWall::Part& part) {
    constexpr double kStepMm = 1e-4;
    double energy_mJ[2];
    for (int side = 0; side < 2; ++side) {
      WireState moved = state;
      energy_mJ[side] =
          at.Rest(MovedWall(at.ring, part, side == 0 ? -kStepMm : kStepMm), moved, nullptr);
    }
    return 1e3 * (energy_mJ[0] - energy_mJ[1]) / (2 * kStepMm);
  };

  const double all_mN = carried_mN([](const Vector3d&) { return true; });
  CHECK(all_mN > 1e-3);
  CHECK(force.sum_mN() == Approx(all_mN).epsilon(1e-4));
  const auto carried_by_tip_mN = [&](double from_tip_mm) {
    const double begins = angle(at_length(from_tip_mm));
    return carried_mN([&](const Vector3d& p) { return angle(p) > begins; });
  };
  const double tip_mN = carried_by_tip_mN(tip_mm);
  CHECK(tip_mN > 1.05 * carried_by_tip_mN(tip_mm / 2));
  CHECK(tip_mN < 0.95 * all_mN);
  CHECK(force.tip_mN() == Approx(tip_mN).epsilon(1e-4));
  double largest_mN = 0;
  int contacts = 0;
  for (double from_tip_mm = 0; from_tip_mm < InRing::kLengthMm - 1; from_tip_mm += lambda / 2) {
    const Vector3d center = at_length(from_tip_mm);
    contacts +=
        carried_mN([&](const Vector3d& p) { return (p - center).norm() < lambda / 8; }) > 1e-6;
    // The four points of a 2 mm patch; this point is the most distal.
    const double ends = angle(at_length(from_tip_mm - lambda / 4));
    const double begins = angle(at_length(from_tip_mm + 2 - lambda / 4));
    largest_mN = std::max(largest_mN, carried_mN([&](const Vector3d& p) {
                            return angle(p) > begins && angle(p) < ends;
                          }));
  }
  CHECK(contacts > 5);
  CHECK(force.largest_mN() == Approx(largest_mN).epsilon(1e-4));
}

TEST_CASE("An event begins above the threshold, and keeps its largest force") {
  const WireModel model = MakeWire({});
  const WireState state(model);
  QuadraticModel quadratic;
  PointSet& points = quadratic.points;
  points = PressedPoint(0);
  const effects::Controls controls;
  const InstrumentPoses target;
  TickReport report;
  report.converged = true;
  effects::WallForce force({.threshold_mN = 10});
  double time_s = 0;
  const auto press = [&](double force_mN) {
    points.clearance[0].clearance_mm = 0.2 - 1e-3 * force_mN;
    force.Observe({.time_s = time_s += 0.25,
                   .step_s = 0.25,
                   .controls = controls,
                   .target = target,
                   .state = state,
                   .quadratic = quadratic,
                   .report = report});
  };
  press(8);
  CHECK(force.events() == 0);
  CHECK(std::isnan(force.event_began_s()));
  for (const double force_mN : {12.0, 30.0, 15.0}) press(force_mN);  // at 0.5, 0.75 and 1 s
  CHECK(force.events() == 1);
  CHECK(force.event_began_s() == 0.5);
  CHECK(force.event_mN() == Approx(30));
  CHECK(force.seconds_above() == 0.75);
  press(5);
  press(20);
  press(4);
  CHECK(force.events() == 2);
  CHECK(ReadingOf(force, "wall_force_event_s") == 1.5);
  CHECK(ReadingOf(force, "wall_force_event_mN") == Approx(20));
  CHECK(force.largest_ever_mN() == Approx(30));
  force.Restart();
  CHECK(std::isnan(force.event_began_s()));
  CHECK(std::isnan(force.event_mN()));
}

TEST_CASE("Measures over the session are unknown until a tick has converged") {
  const WireModel model = MakeWire({});
  const WireState state(model);
  QuadraticModel quadratic;
  quadratic.points = PressedPoint(0.03);
  const effects::Controls controls;
  const InstrumentPoses target;
  TickReport report;
  effects::WallForce force({.threshold_mN = 10});
  const auto observe = [&] {
    force.Observe({.time_s = 1,
                   .step_s = 0.25,
                   .controls = controls,
                   .target = target,
                   .state = state,
                   .quadratic = quadratic,
                   .report = report});
  };
  const auto is_known = [&force](const std::string& name) {
    return !std::isnan(ReadingOf(force, name));
  };
  for (int k = 0; k < 3; ++k) observe();
  for (const char* name :
       {"wall_force_largest_ever_mN", "wall_tip_pressure_ever_kPa", "wall_force_impulse_mNs",
        "wall_force_events", "wall_force_above_s", "wall_force_event_s", "wall_force_event_mN"}) {
    INFO(name);
    CHECK_FALSE(is_known(name));
  }
  CHECK_FALSE(is_known("wall_force_largest_mN"));
  CHECK(ReadingOf(force, "wall_force_unconverged_s") == 0.75);
  quadratic.points = PressedPoint(0.005);
  report.converged = true;
  observe();
  CHECK(ReadingOf(force, "wall_force_largest_mN") == Approx(5));
  CHECK(ReadingOf(force, "wall_force_largest_ever_mN") == Approx(5));
  CHECK(ReadingOf(force, "wall_force_events") == 0);
  CHECK_FALSE(is_known("wall_force_event_s"));
  CHECK_FALSE(is_known("wall_force_event_mN"));
  force.Restart();
  CHECK_FALSE(is_known("wall_force_largest_ever_mN"));
}

TEST_CASE("The force of a patch does not depend on how finely the wire is cut") {
  // A wire straightens in a ring and presses with its tip. The force of a single point falls with
  // the segment length, that of a patch does not.
  const auto readings = [](double segment_mm, int points) {
    const Torus ring(Side::kInside, 30, 1.5);
    const WireModel model = MakeWire({.segment_mm = segment_mm,
                                      .rigidity_N_mm2 = 0.05,
                                      .max_length_mm = 60,
                                      .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}});
    const WallModel wall{.stiffness_N_mm2 = 0.1, .points_per_segment = points};
    const std::vector<EnergyTerm*> none;
    NewtonRelaxation relaxation(model, ring, wall, {.tolerance = 1e-9}, none);
    WireState state(model);
    relaxation.Restart(state);
    const InstrumentPoses target{50, 0};
    const TickReport report = Settle(relaxation, target, state, 400);
    REQUIRE(report.converged);
    auto force = std::make_unique<effects::WallForce>(
        effects::WallForce::Settings{.threshold_mN = 1, .tip_mm = 5, .patch_mm = 2});
    const effects::Controls controls;
    force->Observe({.time_s = 1,
                    .step_s = 1,
                    .controls = controls,
                    .target = target,
                    .state = state,
                    .quadratic = relaxation.Current(),
                    .report = report});
    return force;
  };
  const auto fine = readings(0.25, 4);
  REQUIRE(fine->largest_mN() > 0.01);
  for (const double segment_mm : {2.0, 1.0, 0.5}) {
    for (const int points : {1, 2, 4, 8}) {
      INFO("segments of " << segment_mm << " mm, " << points << " points each");
      const auto force = readings(segment_mm, points);
      // The place of a single contact point is known only to within its piece of wire.
      const double bound = 0.05 + 0.15 * segment_mm / points;
      CHECK(force->sum_mN() == Approx(fine->sum_mN()).epsilon(bound));
      CHECK(force->largest_mN() == Approx(fine->largest_mN()).epsilon(bound));
      CHECK(force->pressure_kPa() == Approx(fine->pressure_kPa()).epsilon(bound));
    }
  }
}

TEST_CASE("Force, line load and pressure of a wire that lies evenly on a wall") {
  // Every point stands for 0.5 mm of wire, the last for half of that. Each is pressed in by 0.05
  // mm. The load is 0.1 N/mm on a round wire of 0.2 mm radius. At 0.05 mm depth its width in the
  // wall is 2 sqrt(0.05 (0.4 - 0.05)) mm.
  PointSet points;
  points.per_segment = 2;
  points.spacing_mm = points.first_spacing_mm = 0.5;
  points.start = Vector3d(-0.5, 0, 0);
  for (int q = 0; q < 13; ++q) {
    points.position.emplace_back(0.5 * q, 0, 0);
    points.near.push_back(q);
  }
  points.weight_mm.assign(13, 0.5);
  points.weight_mm.back() = 0.25;
  points.radius_mm.assign(13, 0.2);
  points.touches.assign(13, 1);
  points.stiffness_N_mm2.assign(13, 2);
  points.clearance.resize(13);
  for (ClearanceSample& sample : points.clearance) {
    sample.gradient = Vector3d::UnitZ();
    sample.clearance_mm = 0.15;
  }
  QuadraticModel quadratic;
  quadratic.points = points;
  const WireModel model = MakeWire({});
  const WireState state(model);
  const effects::Controls controls;
  const InstrumentPoses target;
  TickReport report;
  report.converged = true;
  const double patch_mm = GENERATE(0.7, 1.0, 2.3, 6.0);
  effects::WallForce force({.threshold_mN = 1, .tip_mm = 1.25, .patch_mm = patch_mm});
  const auto observe = [&] {
    force.Observe({.time_s = 1,
                   .step_s = 0.5,
                   .controls = controls,
                   .target = target,
                   .state = state,
                   .quadratic = quadratic,
                   .report = report});
  };
  observe();
  CHECK(force.sum_mN() == Approx(625));
  CHECK(force.largest_mN() == Approx(100 * patch_mm));
  CHECK(force.line_load_mN_mm() == Approx(100));
  CHECK(force.tip_mN() == Approx(125));
  CHECK(force.pressure_kPa() == Approx(100 / (2 * std::sqrt(0.05 * 0.35))));
  CHECK(force.tip_pressure_kPa() == 0);  // pressed sideways
  // A wall ahead of the last point: its 25 mN act on the end face of pi 0.2^2 mm^2.
  quadratic.points.clearance[12].gradient = -Vector3d::UnitX();
  observe();
  CHECK(force.tip_pressure_kPa() == Approx(25 / (3.14159265358979 * 0.04)));
  // Ticks that did not converge count neither for the peak nor as an event.
  const double peak_mN = force.largest_ever_mN();
  const int events = force.events();
  const double impulse = force.impulse_mNs();
  report.converged = false;
  for (ClearanceSample& sample : quadratic.points.clearance) sample.clearance_mm = -1;
  observe();
  CHECK(force.missed_any());
  for (const double now :
       {force.largest_mN(), force.sum_mN(), force.tip_mN(), force.line_load_mN_mm(),
        force.pressure_kPa(), force.tip_pressure_kPa()}) {
    CHECK(std::isnan(now));
  }
  CHECK(force.largest_ever_mN() == peak_mN);
  CHECK(force.events() == events);
  CHECK(force.impulse_mNs() == impulse);
  CHECK(force.unconverged_s() == 0.5);
}

// Two instruments that press on the wall of a ring, both with the whole wall on one patch.
struct WholeWall {
  InstrumentStack stack;
  Torus ring{Side::kInside, 30, 2};
  WallModel wall{.stiffness_N_mm2 = 0.1, .points_per_segment = 2};
  std::vector<EnergyTerm*> none;
  std::unique_ptr<Relaxation> relaxation;
  WireState state;
  effects::WallForce force{{.threshold_mN = 1, .tip_mm = 5, .patch_mm = 500}};

  static WireModel Instrument(double rigidity_N_mm2, double radius_mm, double offset_mm) {
    return MakeWire({.rigidity_N_mm2 = rigidity_N_mm2,
                     .radius_mm = radius_mm,
                     .max_length_mm = 60,
                     .sheath = {Vector3d(30, 0, offset_mm), Vector3d::UnitY()}});
  }
  WholeWall(double second_N_mm2, double second_radius_mm, double offset_mm,
            const Clearance& clearance)
      : stack({Instrument(0.05, 0.2, 0), Instrument(second_N_mm2, second_radius_mm, offset_mm)},
              clearance),
        relaxation(MakeNewtonRelaxation(stack, ring, wall, {.tolerance = 1e-9}, none)),
        state(stack.empty_rod(), 2) {
    relaxation->Restart(state);
    const InstrumentPoses target{{50, 0}, {30, 0}};
    const TickReport report = Settle(*relaxation, target, state, 400);
    REQUIRE(report.converged);
    const effects::Controls controls;
    force.Observe({.time_s = 1,
                   .step_s = 1,
                   .controls = controls,
                   .target = target,
                   .state = state,
                   .quadratic = relaxation->Current(),
                   .report = report});
  }
  // Sum of the wall's forces on a curve, mN.
  double OnCurve(int curve) const {
    const PointSet& points = relaxation->Current().curve(curve).points;
    double sum_mN = 0;
    for (const int q : points.near) {
      const auto p = static_cast<std::size_t>(q);
      if (!points.touches[p]) continue;
      sum_mN += 1e3 * points.stiffness_N_mm2[p] * points.weight_mm[p] *
                (points.radius_mm[p] - points.clearance[p].clearance_mm);
    }
    return sum_mN;
  }
};

TEST_CASE("A patch across a mouth has the forces on both curves") {
  const WholeWall both(
      1, 0.6, 0, {.has_room = {false, true}, .lumen_radius_mm = {0, 0.4}, .stiffness_N_mm2 = 1});
  REQUIRE(both.OnCurve(0) > 0.01);
  REQUIRE(both.OnCurve(1) > 0.01);
  CHECK(both.force.largest_mN() == Approx(both.OnCurve(0) + both.OnCurve(1)).epsilon(1e-6));
}

TEST_CASE("A patch has the forces of one of two instruments beside each other") {
  const WholeWall both(0.05, 0.2, 0.6, {.is_beside = {false, true}, .stiffness_N_mm2 = 1});
  REQUIRE(both.OnCurve(0) > 0.01);
  REQUIRE(both.OnCurve(1) > 0.01);
  CHECK(both.force.largest_mN() ==
        Approx(std::max(both.OnCurve(0), both.OnCurve(1))).epsilon(1e-6));
  CHECK(both.force.sum_mN() == Approx(both.OnCurve(0) + both.OnCurve(1)).epsilon(1e-6));
}

}  // namespace
}  // namespace torquer::test
