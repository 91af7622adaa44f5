// Invariants of every tick, for any stack, vessel, hand motion and budget.
#include <catch2/catch.hpp>
#include <numbers>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/core/relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/invariants.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

using Random = std::mt19937;

// Leads into the torus below.
const Sheath kSheath{Vector3d(30, 0, 0), Vector3d::UnitY()};

double Between(double low, double high, Random& random) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

// Random instruments with one segment length, the outer ones shorter and stiffer.
std::vector<WireModel> RandomInstruments(Random& random, bool twisting) {
  const int count = twisting ? 1 : std::uniform_int_distribution<int>(1, kMostInstruments)(random);
  const double segment_mm = Between(0.5, 2, random);
  std::vector<WireModel> instruments;
  for (int k = 0; k < count; ++k) {
    instruments.push_back(
        MakeWire({.segment_mm = segment_mm,
                  .rigidity_N_mm2 = std::pow(10, Between(-3, -1, random)),
                  .torsional_rigidity_N_mm2 = twisting ? Between(0.01, 0.1, random) : 0,
                  .radius_mm = 0.2 + 0.3 * k,
                  .tip_mm = Between(0, 15, random),
                  .tip_curvature_1_per_mm = Between(-0.1, 0.1, random),
                  .max_length_mm = Between(30, 60, random),
                  .sheath = kSheath}));
  }
  return instruments;
}

// Random targets, including some that an instrument cannot reach.
InstrumentPoses RandomTarget(int count, Random& random) {
  InstrumentPoses target(count);
  for (InstrumentPose& pose : target) {
    pose = {Between(-10, 70, random), Between(-4, 4, random)};
  }
  return target;
}

// Residual of the state at its own reported instrument poses, computed by objects that took no
// part in the tick.
double Residual(const std::vector<WireModel>& instruments, const ClearanceField& field,
                const WallModel& wall, const WireState& state) {
  const InstrumentStack stack(instruments);
  CombinedRods rods(stack);
  rods.Combine(state.poses());
  const std::vector<EnergyTerm*> none;
  WireMechanics mechanics(rods, field, wall, none);
  mechanics.points().SampleStiffness(state);
  QuadraticModel at = mechanics.MakeQuadraticModel();
  mechanics.BuildModel(state, at);
  return at.residual;
}

struct Tester {
  std::vector<WireModel> instruments;
  const ClearanceField& field;
  const WallModel& wall;
  double tolerance;
  bool whole_segments;  // the smallest motion is one segment

  void Check(const InstrumentPoses& target, int units, const TickReport& report,
             const InstrumentStack& stack, const WireState& state) const {
    REQUIRE(report.work <= units);
    REQUIRE_THAT(BrokenGeometry(stack.empty_rod(), state), Catch::Equals(""));
    REQUIRE(report.carried.size() == target.size());
    double reach_mm = 0;
    for (int k = 0; k < target.size(); ++k) {
      INFO("instrument " << k);
      const double length_mm = instruments[static_cast<std::size_t>(k)].max_length_mm();
      const double wanted_mm = std::clamp(target[k].insertion_mm, 0.0, length_mm);
      REQUIRE(report.carried[k].insertion_mm ==
              Approx(wanted_mm - state.poses()[k].insertion_mm).margin(1e-9));
      REQUIRE(report.carried[k].rotation_rad ==
              Approx(target[k].rotation_rad - state.poses()[k].rotation_rad).margin(1e-9));
      reach_mm = std::max(reach_mm, state.poses()[k].insertion_mm);
    }
    // The curve must reach as far as the reported poses.
    if (state.segments() > 0) REQUIRE(state.ArcLength(stack.empty_rod()) == Approx(reach_mm));
    if (target.size() == 1) REQUIRE(state.rotation_rad() == state.poses()[0].rotation_rad);
    if (!report.budget_spent && !whole_segments) REQUIRE(report.arrived());
    // A tick that ends unconverged must report the reason.
    if (!whole_segments) {
      REQUIRE((report.converged || report.budget_spent || report.stalled));
      REQUIRE_FALSE((report.converged && report.stalled));
    }
    if (report.converged) {
      const double residual = Residual(instruments, field, wall, state);
      REQUIRE(residual == Approx(report.residual).epsilon(1e-6).margin(1e-3 * tolerance));
      REQUIRE(residual <= 1.001 * tolerance);
    }
  }
};

TEST_CASE(
    "Every tick ends within its budget and reports the remaining motion, and repeated ticks "
    "arrive") {
  const int seed = GENERATE(range(0, Rounds(40, 4)));
  CAPTURE(seed);
  Random random(static_cast<unsigned>(seed));
  const bool twisting = seed % 5 == 4;
  const Torus torus(Side::kInside, 30, 3);
  const WallModel wall{.stiffness_N_mm2 = 0.05};
  const NewtonSettings settings;
  const Tester tester{RandomInstruments(random, twisting), torus, wall, settings.tolerance, false};
  const std::vector<EnergyTerm*> none;
  InstrumentStack stack(tester.instruments);
  const auto relaxation = MakeNewtonRelaxation(stack, torus, wall, settings, none);
  WireState state(stack.empty_rod(), stack.size());
  relaxation->Restart(state);
  for (int round = 0; round < 8; ++round) {
    const InstrumentPoses target = RandomTarget(stack.size(), random);
    const int units = 1 << std::uniform_int_distribution<int>(0, 6)(random);
    INFO("round " << round << ", " << stack.size() << " instruments, budgets of " << units);
    // 70 mm and 8 rad in parts of half a segment and 0.2 rad, each with a few attempts.
    constexpr int kMostUnits = 20000;
    TickReport report;
    int done = 0;
    do {
      CountedBudget budget(units);
      report = relaxation->Tick(target, budget, state);
      tester.Check(target, units, report, stack, state);
      REQUIRE(report.work > 0);
      done += report.work;
    } while (report.budget_spent && done < kMostUnits);
    CHECK_FALSE(report.budget_spent);
    CHECK(report.arrived() == (report.carried == InstrumentPoses(stack.size())));
  }
}

TEST_CASE("The paper's method does the same, by whole segments") {
  const int seed = GENERATE(range(0, Rounds(8, 4)));
  CAPTURE(seed);
  Random random(static_cast<unsigned>(seed));
  const Torus torus(Side::kInside, 30, 3);
  const WallModel wall{.stiffness_N_mm2 = 0.05, .points_per_segment = 1};
  const PaperSettings settings;
  const WireModel model = MakeWire({.tip_mm = 8,
                                    .tip_curvature_1_per_mm = 0.05,
                                    .max_length_mm = 50,
                                    .law = BendingLaw::kG1,
                                    .sheath = kSheath});
  const Tester tester{{model}, torus, wall, settings.tolerance, true};
  PaperRelaxation relaxation(model, torus, wall, settings);
  WireState state(model);
  relaxation.Restart(state);
  for (int round = 0; round < 4; ++round) {
    const InstrumentPoses target = RandomTarget(1, random);
    const int units = 1 << std::uniform_int_distribution<int>(0, 6)(random);
    INFO("round " << round << ", budgets of " << units);
    TickReport report;
    for (int tick = 0; tick < 200; ++tick) {
      CountedBudget budget(units);
      report = relaxation.Tick(target, budget, state);
      tester.Check(target, units, report, std::as_const(relaxation).stack(), state);
    }
    CHECK(report.carried[0].rotation_rad == 0);
  }
}

TEST_CASE("A turn of 3 rad ends with a budget of 8 units, and 30 mm are not slid in 3") {
  std::vector<WireModel> instruments = {
      MakeWire({.max_length_mm = 80, .sheath = kSheath}),
      MakeWire({.radius_mm = 0.5, .max_length_mm = 80, .sheath = kSheath})};
  InstrumentStack stack(instruments);
  const Torus torus(Side::kInside, 30, 3);
  const WallModel wall{.stiffness_N_mm2 = 0.05};
  const std::vector<EnergyTerm*> none;
  const auto relaxation = MakeNewtonRelaxation(stack, torus, wall, {}, none);
  WireState state(stack.empty_rod(), 2);
  relaxation->Restart(state);
  REQUIRE(Settle(*relaxation, {{60, 0}, {10, 0}}, state, 100).converged);
  CountedBudget eight(8);
  const TickReport turned = relaxation->Tick({{60, 3}, {10, 3}}, eight, state);
  CHECK(turned.work <= 8);
  CHECK(turned.budget_spent);
  CHECK(turned.carried[0].rotation_rad > 1);
  REQUIRE(Settle(*relaxation, {{60, 3}, {10, 3}}, state, 100).converged);
  CountedBudget three(3);
  const TickReport slid = relaxation->Tick({{60, 3}, {40, 3}}, three, state);
  CHECK(slid.carried[1].insertion_mm >= 30 - 3 * 0.5 - 1e-9);
  CHECK_FALSE(slid.converged);
  CHECK(slid.budget_spent);
}

}  // namespace
}  // namespace torquer::test
