#include <catch2/catch.hpp>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "host/simulator/effects/motion/breathing.h"
#include "host/simulator/effects/motion/heartbeat.h"
#include "host/simulator/simulation.h"
#include "host/simulator/vessel/moving_field.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/finite_differences.h"
#include "tests/support/paths.h"
#include "tests/support/scenes.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

using effects::Breathing;
using effects::Heartbeat;
using effects::PeriodicMotion;
using vessel::MovingField;
using vessel::Region;

PeriodicMotion::Settings Beat(const Vector3d& way_mm) {
  PeriodicMotion::Settings settings;
  settings.way_mm = way_mm;
  settings.period_s = 0.8;
  settings.regions.push_back(Region::Ball(Vector3d(20, 3, 0), 4, 12));
  settings.regions.push_back(Region::Ball(Vector3d(12, 15, 2), 3, 10));
  return settings;
}

// Moves everything beyond x = -1000, which includes the whole wire.
PeriodicMotion::Settings Shift(const Vector3d& way_mm) {
  PeriodicMotion::Settings settings;
  settings.way_mm = way_mm;
  settings.period_s = 2;
  settings.regions.push_back(Region::Side(Vector3d(-1000, 0, 0), Vector3d::UnitX(), 1));
  return settings;
}

TEST_CASE("A moving field's gradient and Hessian are those of its clearance, at any time") {
  const Torus torus(Side::kInside, 20, 4);
  Heartbeat beat(Beat(Vector3d(0.5, 1, -0.7)), 0.33);
  Breathing breath(Beat(Vector3d(1, 0, 0.5)), 0.35, 0.1, 0.45);
  MovingField field(torus);
  field.Add(beat);
  field.Add(breath);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> part(0, 1);
  const auto value = [&](const Eigen::VectorXd& x) { return field.Clearance(x); };
  int moved = 0;
  for (int k = 0; k < 200; ++k) {
    field.SetTime(3 * part(random));
    const double angle = 2 * part(random);
    const double ring = 17 + 6 * part(random);
    const Vector3d at(ring * std::cos(angle), ring * std::sin(angle), 4 * part(random) - 2);
    ClearanceSample sample;
    field.EvaluateHessian(at, sample);
    CHECK(sample.clearance_mm == field.Clearance(at));
    CHECK((GradientOf(value, at, 1e-3) - sample.gradient).norm() < 1e-6);
    CHECK((HessianOf(value, at, 3e-3) - sample.hessian).norm() < 2e-3);
    ClearanceSample gradient;
    field.EvaluateGradient(at, gradient);
    CHECK(gradient.gradient == sample.gradient);
    CHECK(sample.gradient.norm() <= field.LipschitzBound());
    const Vector3d rest = field.AtRest(at);
    moved += (rest - at).norm() > 0.1;
    CHECK((field.Moved(rest, rest) - at).norm() < 1e-10);
  }
  CHECK(moved > 50);
}

TEST_CASE("A pulse is 0 at the start, reaches 1, and has no kink up to its second derivative") {
  const bool heart = GENERATE(true, false);
  PeriodicMotion::Settings settings = Shift(Vector3d(1, 0, 0));
  std::unique_ptr<PeriodicMotion> motion;
  if (heart) {
    motion = std::make_unique<Heartbeat>(std::move(settings), 0.33);
  } else {
    motion = std::make_unique<Breathing>(std::move(settings), 0.3, 0.1, 0.4);
  }
  const auto pulse = [&](double part) {
    motion->SetTime(2 * part);
    vessel::Offset offset;
    motion->AddOffset(Vector3d::Zero(), offset);
    return offset.value[0];
  };
  CHECK(pulse(0) == 0);
  CHECK(pulse(1.5) == Approx(pulse(0.5)).margin(1e-12));
  constexpr double kStep = 1e-3;
  double highest = 0;
  double before = 0;
  for (double part = 0; part < 2; part += kStep) {
    highest = std::max(highest, pulse(part));
    const double second =
        (pulse(part + kStep) - 2 * pulse(part) + pulse(part - kStep)) / (kStep * kStep);
    CHECK(std::abs(second - before) < 60 / std::pow(0.3, 3) * kStep * 1.2);
    before = second;
  }
  CHECK(highest == Approx(1).margin(1e-6));
  // The heart rests between beats; breathing pauses, and may be held.
  CHECK(pulse(heart ? 0.78 : 0.85) == 0);
  if (!heart) CHECK(pulse(0.35) == 1);
}

TEST_CASE("A motion's travel holds the way of every place between the times that were set") {
  const Torus torus(Side::kInside, 20, 4);
  Heartbeat beat(Beat(Vector3d(1, 1, 0)), 0.33);
  MovingField field(torus);
  field.Add(beat);
  std::mt19937 random(8);
  std::uniform_real_distribution<double> part(0, 1);
  field.SetTime(0);
  for (int k = 0; k < 200; ++k) {
    const Vector3d at(30 * part(random), 30 * part(random), 4 * part(random));
    const double clearance = field.Clearance(at);
    const double travel = field.TravelMm();
    field.SetTime(2 * part(random));
    CHECK(field.TravelMm() >= travel);
    CHECK(std::abs(field.Clearance(at) - clearance) <= field.TravelMm() - travel + 1e-12);
  }
}

TEST_CASE("Skipped look-ups change no bit where the vessel moves") {
  const Torus torus(Side::kInside, 20, 2);
  Heartbeat beat(Beat(Vector3d(1, 2, -0.7)), 0.33);
  MovingField field(torus);
  field.Add(beat);
  field.SetTime(0);
  const WireModel model = MakeWire({.sheath = {Vector3d(20, 0, 0), Vector3d::UnitY()}});
  const WallModel wall{.stiffness_N_mm2 = 5e-3};
  const std::vector<EnergyTerm*> none;
  WireMechanics skipping(model, field, wall, none);
  WireMechanics asking(model, field, wall, none);
  QuadraticModel a = skipping.MakeQuadraticModel();
  QuadraticModel b = asking.MakeQuadraticModel();
  std::vector<Vector3d> path;
  for (double t = 0.02; t < 1.5; t += 0.02)
    path.emplace_back(20 * std::cos(t), 20 * std::sin(t), 0);
  WireState state = WireState::Along(model, path, {25, 0});
  std::mt19937 random(3);
  std::uniform_real_distribution<double> step(-3e-3, 3e-3);
  int touching = 0;
  int free = 0;
  for (int k = 0; k < 2000; ++k) {
    field.SetTime(1e-3 * k);
    std::vector<Vector2d> xi;
    for (int i = 0; i < state.segments(); ++i) xi.emplace_back(step(random), step(random));
    const WireState there = Stepped(model, state, xi);
    asking.points().Forget();
    skipping.BuildModel(there, a);
    asking.BuildModel(there, b);
    REQUIRE(a.energy_mJ == b.energy_mJ);
    REQUIRE(a.residual == b.residual);
    REQUIRE(a.points.touches == b.points.touches);
    REQUIRE(a.points.near == b.points.near);
    (a.points.near.empty() ? free : touching) += 1;
  }
  CHECK(touching > 100);
  CHECK(free > 100);
}

TEST_CASE("Friction's anchors go with their places on the wall") {
  const HalfSpace plane(Vector3d::Zero(), Vector3d::UnitZ());
  const Vector3d way(0.3, -0.2, 0);
  Breathing breath(Shift(way), 0.4, 0.2, 0.4);
  MovingField field(plane);
  field.Add(breath);
  field.SetTime(0);
  const WireModel model = MakeWire({.segment_mm = 1, .max_length_mm = 3});
  const WallModel wall{.stiffness_N_mm2 = 2, .points_per_segment = 1};
  effects::EffectContext context{model, wall};
  context.moving = &field;
  effects::Friction friction(0.3, 0.01, context);
  PointSet points;
  points.position = {Vector3d(1, 2, 0.1)};
  points.weight_mm = {1};
  points.radius_mm = {0.178};
  points.touches = {1};
  points.near = {0};
  points.stiffness_N_mm2 = {2};
  points.clearance.resize(1);
  points.clearance[0].clearance_mm = 0.1;
  points.clearance[0].gradient = Vector3d::UnitZ();
  PointDerivatives out;
  out.used = {0};
  out.gradient.resize(1);
  out.hessian.resize(1);
  friction.Begin(points);
  friction.End(points);
  field.SetTime(1);  // breath held: displaced by the full amplitude
  friction.Begin(points);
  CHECK(friction.Add(points, out) > 0);
  CHECK(out.gradient[0].dot(way) < -0.9 * out.gradient[0].norm() * way.norm());
  points.position[0] += way;
  out.used = {0};
  CHECK(friction.Add(points, out) == Approx(0).margin(1e-18));
}

TEST_CASE("A wire in a translating vessel has the shape of one whose sheath moves the other way") {
  const Torus torus(Side::kInside, 40, 3);
  const WallModel wall{.stiffness_N_mm2 = 0.05};
  const std::vector<EnergyTerm*> none;
  const Vector3d way(0.7, 0.4, 0.5);
  const auto make = [](const Vector3d& point) {
    return MakeWire({.rigidity_N_mm2 = 0.5, .sheath = {point, Vector3d::UnitY()}});
  };
  std::vector<Vector3d> path;
  for (double t = 0.02; t < 1.8; t += 0.02)
    path.emplace_back(40 * std::cos(t), 40 * std::sin(t), 0);

  Breathing breath(Shift(way), 0.4, 0.2, 0.4);
  MovingField field(torus);
  field.Add(breath);
  field.SetTime(0);
  const WireModel model = make(Vector3d(40, 0, 0));
  NewtonRelaxation relaxation(model, field, wall, {.tolerance = 1e-8}, none);
  WireState state = WireState::Along(model, path, {60, 0});
  relaxation.Restart(state);
  REQUIRE(Settle(relaxation, {60, 0}, state).converged);
  const WireState before = state;
  const double energy = relaxation.Current().energy_mJ;
  for (int k = 1; k <= 100; ++k) {
    field.SetTime(0.01 * k);
    REQUIRE(Settle(relaxation, {60, 0}, state).converged);
  }
  CHECK((field.AtRest(Vector3d::Zero()) + way).norm() < 1e-12);

  const WireModel other = make(Vector3d(40, 0, 0) - way);
  NewtonRelaxation resting(other, torus, wall, {.tolerance = 1e-8}, none);
  WireState expected(other);
  std::vector<Vector3d> shifted = path;
  expected = WireState::Along(other, shifted, {60, 0});
  resting.Restart(expected);
  REQUIRE(Settle(resting, {60, 0}, expected).converged);
  double worst = 0;
  for (std::size_t i = 0; i < state.nodes().size(); ++i) {
    worst = std::max(worst, (state.nodes()[i] - way - expected.nodes()[i]).norm());
  }
  CHECK(worst < 1e-4);
  // Far from the sheath the wire moved with the vessel, at least across it.
  CHECK(LargestDistance(state, before) > 0.3);

  // After the return no change remains: without friction a closed cycle loses no energy.
  for (int k = 100; k <= 200; ++k) {
    field.SetTime(0.01 * k);
    REQUIRE(Settle(relaxation, {60, 0}, state).converged);
  }
  CHECK(LargestDistance(state, before) < 1e-4);
  CHECK(relaxation.Current().energy_mJ == Approx(energy).epsilon(1e-6));
}

constexpr char kMotions[] =
    "[effects.heartbeat]\namplitude_mm = 2\ndirection = [0, 0, 1]\n"
    "[[effects.heartbeat.region]]\ncenter_mm = [60, 0, 0]\nradius_mm = 10\nedge_mm = 20\n"
    "[effects.breathing]\namplitude_mm = 5\ndirection = \"superior\"\nphase = 0.3\n"
    "[[effects.breathing.region]]\nside_of_mm = [80, 0, 0]\nside = [1, 0, 0]\nedge_mm = 40\n"
    "[effects.friction]\ncoefficient = 0.1\n";

TEST_CASE("A session in a moving vessel is repeated to the bit, and is restarted") {
  const SceneFile file(kMotions);
  scene::Scene scene(file.path());
  simulator::Simulation session(scene);
  CHECK(session.is_time_dependent());
  struct Step {
    simulator::Command command;
    int work;
    std::uint64_t hash;
  };
  std::vector<Step> steps;
  std::mt19937 random(2);
  std::uniform_int_distribution<int> units(2, 12);
  std::uniform_real_distribution<double> pause(5e-4, 5e-3);
  simulator::Command command;
  command.target = session.target();
  command.time_s = 0;
  std::size_t different = 0;
  for (int k = 0; k < 400; ++k) {
    command.time_s += pause(random);
    if (k % 3 == 0) command.target[0].insertion_mm += 0.05;
    CountedBudget budget(units(random));
    session.Tick(command, budget);
    steps.push_back({command, session.report().work, session.state_hash()});
    different += k > 0 && steps[steps.size() - 2].hash != session.state_hash();
  }
  CHECK(different > 390);  // it never rests
  const auto repeat = [&](simulator::Simulation& other) {
    for (const Step& step : steps) {
      CountedBudget budget(step.work);
      other.Tick(step.command, budget);
      REQUIRE(other.state_hash() == step.hash);
    }
  };
  scene::Scene second(file.path());
  simulator::Simulation again(second);
  repeat(again);
  session.Restart();
  repeat(session);
}

TEST_CASE("A wire at rest follows a beating heart in few attempts") {
  const SceneFile file(
      "[effects.heartbeat]\namplitude_mm = 2\ndirection = [0, 0, 1]\n"
      "[[effects.heartbeat.region]]\ncenter_mm = [60, 0, 0]\nradius_mm = 10\nedge_mm = 20\n"
      "[effects.friction]\ncoefficient = 0.1\n");
  scene::Scene scene(file.path());
  simulator::Simulation session(scene);
  simulator::Command command;
  command.target = session.target();
  CountedBudget plenty(100000);
  while (command.target[0].insertion_mm < 80) {
    command.target[0].insertion_mm += 0.5;
    command.time_s += 0.005;
    REQUIRE(session.Tick(command, plenty).converged);
  }
  constexpr int kTicks = 400;
  int moved = 0;
  int work = 0;
  for (int k = 0; k < kTicks; ++k) {
    command.time_s += 0.005;
    const std::uint64_t before = session.state_hash();
    const TickReport report = session.Tick(command, plenty);
    REQUIRE(report.converged);
    moved += session.state_hash() != before;
    work += report.work;
  }
  CHECK(moved > kTicks / 4);
  INFO(work << " attempts in " << moved << " ticks with motion");
  CHECK(work < 2 * moved);
}

TEST_CASE("The shipped scenes of these effects start and run, and the drill has no effect") {
  const std::string folder = SourcePath("/host/scenes/");
  for (const std::string name : {"drill_tube", "calcified", "beating_heart"}) {
    INFO(name);
    scene::Scene scene(folder + name + ".toml");
    CHECK(scene.effect_names().empty() == (name == "drill_tube"));
    simulator::Simulation session(scene);
    simulator::Command command;
    command.target = session.target();
    for (int k = 1; k <= 100; ++k) {
      command.time_s = 0.02 * k;
      command.target[0].insertion_mm += 0.5;
      CountedBudget budget(scene.budget_units());
      REQUIRE(session.Tick(command, budget).converged);
    }
  }
}

}  // namespace
}  // namespace torquer::test
