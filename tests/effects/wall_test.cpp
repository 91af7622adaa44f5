// Local properties along the wall or the wire: compliance, friction by place, sections.
#include <catch2/catch.hpp>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/compliance.h"
#include "host/simulator/effects/contact/friction.h"
#include "host/simulator/effects/loads/gravity.h"
#include "host/simulator/effects/motion/breathing.h"
#include "host/simulator/scene/scene_spec.h"
#include "host/simulator/vessel/moving_field.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

using effects::Compliance;
using vessel::Region;

constexpr double kWeight_N_mm = 1e-3;
constexpr double kElsewhere_N_mm2 = 0.05;
constexpr double kSoft_N_mm2 = 0.01;
constexpr double kCalcified_N_mm2 = 1;

// 90 mm of wire along x on a floor under its weight; parts of the floor have another stiffness.
struct LyingWire {
  LyingWire(const ClearanceField& field, std::vector<Compliance::RegionStiffness> regions,
            const vessel::MovingField* moving = nullptr)
      : compliance(std::move(regions), Context(moving)),
        relaxation(model, field, SoftWall(), {.tolerance = 1e-8}, terms),
        state(LayStraight(model, 90)) {
    relaxation.Restart(state);
  }
  bool Settles() { return Settle(relaxation, {90, 0}, state).converged; }
  double Penetration_mm(int node) const {
    return kRadius_mm - state.nodes()[static_cast<std::size_t>(node)][2];
  }

  static constexpr double kRadius_mm = 0.2;
  WireModel model = MakeWire({.rigidity_N_mm2 = 1e-3,
                              .radius_mm = kRadius_mm,
                              .sheath = {Vector3d(0, 0, 0.19), Vector3d::UnitX()}});
  WallModel wall{.stiffness_N_mm2 = kElsewhere_N_mm2};
  Compliance compliance;
  effects::Gravity gravity{{Vector3d(0, 0, -kWeight_N_mm)}};
  std::vector<EnergyTerm*> terms{&gravity};
  NewtonRelaxation relaxation;
  WireState state;

 private:
  effects::EffectContext Context(const vessel::MovingField* moving) const {
    effects::EffectContext context{model, wall};
    context.moving = moving;
    return context;
  }
  const WallModel& SoftWall() {
    wall.stiffness_field = compliance.wall_stiffness();
    return wall;
  }
};

Compliance::RegionStiffness Patch(double x_mm, double stiffness_N_mm2) {
  return {Region::Ball(Vector3d(x_mm, 0, 0), 8, 2), stiffness_N_mm2};
}

TEST_CASE("A wire lying on a wall sinks in by its weight over the stiffness of the place") {
  const HalfSpace floor(Vector3d::Zero(), Vector3d::UnitZ());
  LyingWire wire(floor, {Patch(25, kSoft_N_mm2), Patch(70, kCalcified_N_mm2)});
  REQUIRE(wire.Settles());
  CHECK(wire.Penetration_mm(25) == Approx(kWeight_N_mm / kSoft_N_mm2).epsilon(1e-3));
  CHECK(wire.Penetration_mm(48) == Approx(kWeight_N_mm / kElsewhere_N_mm2).epsilon(1e-3));
  CHECK(wire.Penetration_mm(70) == Approx(kWeight_N_mm / kCalcified_N_mm2).epsilon(1e-3));
}

TEST_CASE("A calcified part moves with the vessel under a wire at rest") {
  const HalfSpace floor(Vector3d::Zero(), Vector3d::UnitZ());
  // The floor slides along the wire by 30 mm within a breath.
  effects::PeriodicMotion::Settings settings;
  settings.way_mm = Vector3d(30, 0, 0);
  settings.period_s = 2;
  settings.regions.push_back(Region::Side(Vector3d(-1000, 0, 0), Vector3d::UnitX(), 1));
  effects::Breathing breath(std::move(settings), 0.4, 0.1, 0.5);
  vessel::MovingField field(floor);
  field.Add(breath);
  field.SetTime(0);
  LyingWire wire(field, {Patch(25, kSoft_N_mm2)}, &field);
  for (const double time_s : {0.0, 0.9, 2.0}) {
    field.SetTime(time_s);
    REQUIRE(wire.Settles());
    const bool away = time_s == 0.9;
    const double here_N_mm2 = away ? kElsewhere_N_mm2 : kSoft_N_mm2;
    const double there_N_mm2 = away ? kSoft_N_mm2 : kElsewhere_N_mm2;
    CHECK(wire.Penetration_mm(25) == Approx(kWeight_N_mm / here_N_mm2).epsilon(1e-3));
    CHECK(wire.Penetration_mm(55) == Approx(kWeight_N_mm / there_N_mm2).epsilon(1e-3));
  }
}

TEST_CASE("Stiffness changes along an edge without a step, and later parts replace earlier ones") {
  const WireModel model = MakeWire({});
  const WallModel wall{.stiffness_N_mm2 = 2};
  std::vector<Compliance::RegionStiffness> regions;
  regions.push_back({Region::Ball(Vector3d::Zero(), 5, 5), 200});
  regions.push_back({Region::Ball(Vector3d(4, 0, 0), 1, 1), 0.5});
  const Compliance compliance(std::move(regions), {model, wall});
  CHECK(compliance.At(Vector3d(-20, 0, 0)) == 2);
  CHECK(compliance.At(Vector3d(-5, 0, 0)) == Approx(200));
  CHECK(compliance.At(Vector3d(-7.5, 0, 0)) == Approx(20));  // halfway on a logarithmic scale
  CHECK(compliance.At(Vector3d(4, 0.5, 0)) == Approx(0.5));
  double before = 200;
  for (double x = -5; x > -10; x -= 0.01) {
    const double now = compliance.At(Vector3d(x, 0, 0));
    CHECK(now <= before * (1 + 1e-12));
    CHECK(now > 0.97 * before);
    before = now;
  }
}

// Points of a wire on a plane, 1 mm apart, each pressed with 0.1 N.
struct Row {
  static constexpr int kPoints = 10;
  WireModel model = MakeWire({.segment_mm = 1, .max_length_mm = 20});
  WallModel wall{.stiffness_N_mm2 = 2, .points_per_segment = 1};
  PointSet points;
  PointDerivatives derivatives;

  Row() {
    for (int q = 0; q < kPoints; ++q) {
      points.position.emplace_back(q, 0, 0);
      points.near.push_back(q);
    }
    points.weight_mm.assign(kPoints, 1);
    points.radius_mm.assign(kPoints, 0.178);
    points.touches.assign(kPoints, 1);
    points.stiffness_N_mm2.assign(kPoints, 2);
    ClearanceSample sample;
    sample.clearance_mm = 0.178 - 0.05;
    sample.gradient = Vector3d::UnitZ();
    points.clearance.assign(kPoints, sample);
    derivatives.used.assign(kPoints, 0);
    derivatives.gradient.resize(kPoints);
    derivatives.hessian.resize(kPoints);
  }
  // Force on each point after all were moved sideways far beyond the slip length.
  std::vector<double> Slipping(effects::Friction& friction) {
    friction.Begin(points);
    friction.End(points);
    friction.Begin(points);
    for (Vector3d& at : points.position) at[1] += 0.5;
    friction.Add(points, derivatives);
    std::vector<double> forces;
    for (const Vector3d& gradient : derivatives.gradient) forces.push_back(gradient.norm());
    return forces;
  }
};

TEST_CASE("Friction has the coefficient of the wire's coating and of the wall's part") {
  Row row;
  std::vector<effects::Friction::RegionFactor> regions;
  regions.push_back({Region::Ball(Vector3d(2, 0, 0), 1.2, 0.3), 3.0});
  effects::EffectContext context{row.model, row.wall};
  context.instruments = {
      {.name = "guidewire", .model = &row.model, .coating_mm = 4, .coating_coefficient = 0.05}};
  effects::Friction friction(0.2, 0.005, context, std::move(regions));
  const std::vector<double> forces = row.Slipping(friction);
  for (int q = 0; q < Row::kPoints; ++q) {
    INFO("point " << q);
    const double own = q >= 6 ? 0.05 : 0.2;  // the last four millimeters are coated
    const double factor = q >= 1 && q <= 3 ? 3 : 1;
    CHECK(forces[static_cast<std::size_t>(q)] == Approx(own * factor * 0.1));
  }
}

// Compares the force on each point with its coefficient, ordered from the tip.
void CheckFromTip(const std::vector<double>& forces, const std::vector<double>& coefficients) {
  REQUIRE(coefficients.size() == static_cast<std::size_t>(Row::kPoints));
  for (std::size_t k = 0; k < coefficients.size(); ++k) {
    INFO("point " << k << " from the tip");
    CHECK(forces[Row::kPoints - 1 - k] == Approx(coefficients[k] * 0.1));
  }
}

TEST_CASE("Each instrument of a stack has its own friction, its own coating and its own end") {
  Row row;
  // The catheter ends 3 mm behind the wire's tip.
  row.points.instruments.last = 2;
  row.points.instruments.behind_mm = {0, 3};
  effects::EffectContext context{row.model, row.wall};
  context.instruments = {
      {.name = "guidewire", .model = &row.model, .coating_mm = 2, .coating_coefficient = 0.05},
      {.name = "catheter",
       .model = &row.model,
       .friction_coefficient = effects::ValuesAlong(0.3),
       .coating_mm = 1.5,
       .coating_coefficient = 0.1}};
  effects::Friction friction(0.2, 0.005, context);
  // From the tip: two points of the coated wire, one of the bare one, two of the coated catheter.
  CheckFromTip(row.Slipping(friction), {0.05, 0.05, 0.2, 0.1, 0.1, 0.3, 0.3, 0.3, 0.3, 0.3});
}

TEST_CASE("Friction follows the list of coefficients along each instrument") {
  Row row;  // points 1 mm apart
  row.points.instruments.last = 2;
  row.points.instruments.behind_mm = {0, 3};
  effects::EffectContext context{row.model, row.wall};
  // The wire has a step 1.5 mm from its tip. The catheter's coefficient rises linearly.
  context.instruments = {
      {.name = "guidewire",
       .model = &row.model,
       .friction_coefficient = effects::ValuesAlong({0, 1.5, 1.5 + 1e-6}, {0.05, 0.05, 0.3})},
      {.name = "catheter",
       .model = &row.model,
       .friction_coefficient = effects::ValuesAlong({1, 5}, {0.1, 0.5})}};
  effects::Friction friction(0.2, 0.005, context);
  CheckFromTip(row.Slipping(friction), {0.05, 0.05, 0.3, 0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.5});
}

TEST_CASE("A cantilever with a step in its rigidity bends by the closed form") {
  constexpr double kLength = 60;
  scene::InstrumentSpec wire;
  constexpr double kStep = 20;
  wire.from_tip_mm = {0, kStep, kStep};
  wire.rigidity_N_mm2 = {0.5, 0.5, 4};
  wire.radius_mm = {0.2};
  const std::vector<WireSection> sections = scene::MakeSections(wire);
  REQUIRE(sections.size() == 3);
  double error[2];
  int k = 0;
  for (const double segment_mm : {1.0, 0.5}) {
    const WireModel model(segment_mm, sections, 0, 100, BendingLaw::kExact, {});
    const FreeSpace field;
    const WallModel wall;
    constexpr double kForce = 1e-6;
    EndForce force(Vector3d(0, kForce, 0));
    const std::vector<EnergyTerm*> terms{&force};
    NewtonRelaxation relaxation(model, field, wall, {.tolerance = 1e-9}, terms);
    WireState state = LayStraight(model, kLength);
    relaxation.Restart(state);
    REQUIRE(Settle(relaxation, {kLength, 0}, state).converged);
    const double tip = std::pow(kStep, 3);
    const double expected = kForce * ((std::pow(kLength, 3) - tip) / (3 * 4) + tip / (3 * 0.5));
    error[k++] = state.nodes().back()[1] / expected - 1;
  }
  INFO("errors " << error[0] << " " << error[1]);
  CHECK(std::abs(error[1]) < 2e-4);
  CHECK(error[0] / error[1] == Approx(4).epsilon(0.1));
}

}  // namespace
}  // namespace torquer::test
