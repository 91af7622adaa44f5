// Weight and mass of instruments with clearance in a lumen.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/loads/gravity.h"
#include "host/simulator/effects/loads/inertia.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/finite_differences.h"
#include "tests/support/two_curves.h"

namespace torquer::test {
namespace {

// Straight instruments in free space, the inner one in a lumen so wide that they never touch.
struct Apart {
  static constexpr double kLumen_mm = 30;
  InstrumentStack stack;
  FreeSpace field;
  WallModel wall{.points_per_segment = 2};
  std::unique_ptr<effects::Gravity> gravity;
  std::unique_ptr<effects::Inertia> inertia;
  std::vector<EnergyTerm*> terms;
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  static std::vector<WireModel> Instruments() {
    std::vector<WireModel> both;
    both.push_back(MakeWire({.rigidity_N_mm2 = 0.02, .radius_mm = 0.2}));
    both.push_back(MakeWire({.rigidity_N_mm2 = 0.05, .radius_mm = 40}));
    return both;
  }
  // Inertia with ticks of `step_s` seconds; 0 means no inertia.
  explicit Apart(const std::vector<double>& weights_N_mm, double step_s = 0)
      : stack(Instruments(),
              {.has_room = {false, true}, .lumen_radius_mm = {0, kLumen_mm}, .stiffness_N_mm2 = 1}),
        gravity(std::make_unique<effects::Gravity>(
            std::vector<Vector3d>{{0, -weights_N_mm[0], 0}, {0, -weights_N_mm[1], 0}})),
        terms{gravity.get()},
        state(stack.empty_rod(), 2) {
    if (step_s > 0) {
      effects::EffectContext context{stack.empty_rod(), wall};
      context.stack = &stack;
      inertia = std::make_unique<effects::Inertia>(
          effects::Inertia::Settings{.linear_density_g_m = {0.7, 2}}, context);
      terms.push_back(inertia.get());
    }
    relaxation = MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, terms);
    relaxation->Restart(state);
  }
  void MoveTo(const InstrumentPoses& poses) {
    REQUIRE(Settle(*relaxation, poses, state, 400).converged);
  }
};

// A single wire with the properties of one of the instruments.
struct Lone {
  WireModel model;
  FreeSpace field;
  WallModel wall{.points_per_segment = 2};
  effects::Gravity gravity;
  std::unique_ptr<effects::Inertia> inertia;
  std::vector<EnergyTerm*> terms{&gravity};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  Lone(int instrument, double weight_N_mm, double step_s = 0)
      : model(Apart::Instruments()[static_cast<std::size_t>(instrument)]),
        gravity({Vector3d(0, -weight_N_mm, 0)}),
        state(model) {
    if (step_s > 0) {
      effects::EffectContext context{model, wall};
      inertia = std::make_unique<effects::Inertia>(
          effects::Inertia::Settings{.linear_density_g_m = {instrument == 0 ? 0.7 : 2.0}}, context);
      terms.push_back(inertia.get());
    }
    relaxation = MakeNewtonRelaxation(model, field, wall, {.tolerance = 1e-9}, terms);
    relaxation->Restart(state);
  }
};

TEST_CASE("Instruments that do not touch hang as each does alone, for any leader") {
  const InstrumentPoses poses =
      GENERATE(InstrumentPoses{{52.3, 0}, {41.9, 0}}, InstrumentPoses{{38.6, 0}, {47.2, 0}});
  const std::vector<double> weights_N_mm{2e-7, 9e-7};
  Apart both(weights_N_mm);
  both.MoveTo(poses);
  for (int k = 0; k < 2; ++k) {
    CAPTURE(poses[0].insertion_mm, k);
    Lone alone(k, weights_N_mm[static_cast<std::size_t>(k)]);
    REQUIRE(Settle(*alone.relaxation, {poses[k].insertion_mm, 0}, alone.state).converged);
    const Vector3d tip =
        PointAt(both.stack.empty_rod(k), both.state.curve(k), poses[k].insertion_mm);
    const double sunk_mm = -alone.state.tip()[1];
    CHECK(sunk_mm > 1);
    CHECK(-tip[1] == Approx(sunk_mm).epsilon(2e-3));
  }
}

TEST_CASE("An instrument weighs as much as is of it, wherever its tip falls") {
  Apart both({1e-7, 1e-7});
  both.MoveTo({{30, 0}, {22, 0}});
  PointSet points = both.relaxation->Current().points;
  const double in_sheath_mm = points.first_spacing_mm / 2;
  for (double behind_mm = 0; behind_mm < 29; behind_mm += 0.0837) {
    points.instruments.behind_mm[0] = behind_mm;
    double length_mm = 0;
    for (int q = 0; q < points.size(); ++q) {
      length_mm += points.CoverageOf(0, q) * points.weight_mm[static_cast<std::size_t>(q)];
    }
    CHECK(length_mm == Approx(30 - behind_mm - in_sheath_mm).margin(1e-9));
  }
}

TEST_CASE("Weight and mass of two curves have the gradient of finite differences") {
  const InstrumentPoses poses =
      GENERATE(kWireLeads, kCatheterLeads, kThreeWireLeads, kThreeCatheterLeads);
  TwoCurves curves(poses, GENERATE(1, 3), 11, 0.7);
  effects::Gravity gravity(
      {Vector3d(1e-5, 2e-5, 0), Vector3d(-2e-5, 0, 1e-5), Vector3d(0, 1e-5, 2e-5)});
  effects::EffectContext context{curves.model, curves.wall};
  context.stack = &curves.stack;
  effects::Inertia inertia(
      {.linear_density_g_m = {0.7, 2, 3}, .fluid_kg_m3 = 1060, .drag_mPa_s = 7}, context);
  curves.terms.push_back(&gravity);
  curves.terms.push_back(&inertia);
  curves.at = curves.mechanics.MakeQuadraticModel();
  curves.mechanics.BuildModel(curves.state, curves.at);
  inertia.AdvanceTime(0.002);
  for (int c = 0; c < curves.stack.curves(); ++c) inertia.Begin(curves.at.curve(c).points);
  Eigen::VectorXd x = Eigen::VectorXd::Constant(curves.unknowns(), 8e-3);
  for (Eigen::Index k = 0; k < x.size(); k += 3) x[k] = -5e-3;
  curves.state = curves.Stepped(x);
  curves.Forget();
  curves.mechanics.BuildModel(curves.state, curves.at);
  REQUIRE(curves.at.dissipated_mJ > 1e-8);
  const Eigen::VectorXd gradient =
      GradientOf([&](const Eigen::VectorXd& step) { return curves.Energy(step); },
                 Eigen::VectorXd::Zero(curves.unknowns()), 1e-4);
  CHECK((gradient - curves.Gradient()).norm() < 1e-6 * gradient.norm());
}

// Integral of the squared radius over the arc length from a place on, mm^3. At each place, the
// radius is that of the outermost of some instruments of TwoCurves.
double SquaredRadii(const InstrumentPoses& poses, InstrumentStack::Range range, double from_mm) {
  constexpr double kRadii_mm[] = {0.2, 0.5, 0.9};
  double sum = 0;
  for (int k = range.last - 1; k >= range.first; --k) {
    sum += std::max(0.0, poses[k].insertion_mm - from_mm) * kRadii_mm[k] * kRadii_mm[k];
    from_mm = std::max(from_mm, poses[k].insertion_mm);
  }
  return sum;
}

TEST_CASE("Instruments move with their own mass and twice the blood that they displace") {
  const std::vector<double> density_g_m{0.7, 2, 3};
  const double fluid_kg_m3 = 1060;
  const InstrumentPoses poses =
      GENERATE(kWireLeads, kCatheterLeads, kThreeWireLeads, kThreeCatheterLeads);
  const bool in_catheter = GENERATE(false, true);
  const bool in_guide = GENERATE(false, true);
  if (in_guide && (poses.size() < 3 || !in_catheter)) return;
  TwoCurves curves(poses, 2, 11, 0, {false, in_catheter, in_guide});
  effects::EffectContext context{curves.model, curves.wall};
  context.stack = &curves.stack;
  effects::Inertia inertia({.linear_density_g_m = density_g_m, .fluid_kg_m3 = fluid_kg_m3},
                           context);
  const double step_s = 0.001;
  inertia.AdvanceTime(step_s);
  const Vector3d moved_mm(0.1, 0.2, -0.3);
  Vector3d force_N = Vector3d::Zero();
  double mass_mg = 0;
  for (int c = 0; c < curves.stack.curves(); ++c) {
    PointSet points = curves.at.curve(c).points;
    inertia.Begin(points);
    for (Vector3d& at : points.position) at += moved_mm;
    PointDerivatives out;
    out.Clear(points.position.size());
    inertia.Add(points, out);
    for (const Vector3d& gradient : out.gradient) force_N += gradient;
    // The sheath holds the first half piece of each curve.
    const double held_mm = points.first_spacing_mm / 2;
    const InstrumentStack::Range range = curves.stack.OnCurve(c);
    for (int k = range.first; k < range.last; ++k) {
      mass_mg += density_g_m[static_cast<std::size_t>(k)] * (poses[k].insertion_mm - held_mm);
    }
    double volume_mm3 = SquaredRadii(poses, range, held_mm);
    if (c > 0) {
      InstrumentPoses within = poses;
      for (int k = 0; k < range.first; ++k) {
        within[k].insertion_mm =
            std::min(poses[k].insertion_mm, curves.state.curve(c).insertion_mm());
      }
      volume_mm3 -= SquaredRadii(within, {curves.stack.OnCurve(c - 1).first, range.first}, held_mm);
    }
    mass_mg += 2e-3 * fluid_kg_m3 * std::numbers::pi * volume_mm3;
  }
  const Vector3d expected_N = 1e-9 * mass_mg / (step_s * step_s) * moved_mm;
  CHECK((force_N - expected_N).norm() < 1e-9 * expected_N.norm());
}

// The instruments fall from a straight line and are fed and withdrawn meanwhile. If they do not
// touch, each oscillates as if alone.
TEST_CASE("Instruments that do not touch swing as each does alone, for any leader") {
  constexpr double kStep_s = 0.002;
  const bool wire_leads = GENERATE(true, false);
  const std::vector<double> weights_N_mm{3e-7, 1e-6};
  Apart both(weights_N_mm, kStep_s);
  Lone alone[2] = {Lone(0, weights_N_mm[0], kStep_s), Lone(1, weights_N_mm[1], kStep_s)};
  const auto poses_at = [&](int tick) {
    // Both rest, then one slides in the other; at the end they swap places.
    const double way = 0.02 * tick;
    return wire_leads ? InstrumentPoses{{42.3 + way, 0}, {36.1, 0}}
                      : InstrumentPoses{{31.7 + way, 0}, {40.2, 0}};
  };
  double farthest_mm = 0;
  for (int tick = 0; tick < 600; ++tick) {
    const InstrumentPoses poses = poses_at(tick);
    const auto move = [&](effects::Inertia& inertia, Relaxation& relaxation,
                          const InstrumentPoses& to, WireState& state) {
      inertia.AdvanceTime(kStep_s);
      CountedBudget budget(100000);
      REQUIRE(relaxation.Tick(to, budget, state).converged);
    };
    move(*both.inertia, *both.relaxation, poses, both.state);
    for (int k = 0; k < 2; ++k) {
      move(*alone[k].inertia, *alone[k].relaxation, {poses[k].insertion_mm, 0}, alone[k].state);
      const Vector3d tip =
          PointAt(both.stack.empty_rod(k), both.state.curve(k), poses[k].insertion_mm);
      CAPTURE(wire_leads, tick, k);
      REQUIRE((tip - alone[k].state.tip()).norm() < 0.05);
      farthest_mm = std::max(farthest_mm, -tip[1]);
    }
  }
  CHECK(farthest_mm > 2);
}

}  // namespace
}  // namespace torquer::test
