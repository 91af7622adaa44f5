// Section 3.3 and Fig. 10 of Baier et al. 2016, and the model that the paper starts from.
#include <catch2/catch.hpp>
#include <limits>
#include <random>

#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/core/paper/predecessor_relaxation.h"
#include "host/simulator/vessel/phantoms.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// A wire in the T-Y phantom after Tip Relaxations only: 80 segments of 2.5 mm.
struct Case {
  explicit Case(PaperCycles cycles = PaperCycles::kGeometrical, double length_mm = 200)
      : model(MakeWire({.segment_mm = 2.5,
                        .tip_mm = 7.5,
                        .max_length_mm = 250,
                        .law = BendingLaw::kG1,
                        .sheath = {{1, 0, 0}, {1, 0, 0}}})),
        state(model) {
    settings.cycles = cycles;
    PaperSettings tip_only;
    tip_only.cycles = PaperCycles::kNone;
    PaperRelaxation relaxation(model, field, wall, tip_only);
    relaxation.Restart(state);
    CountedBudget budget(1000);
    relaxation.Tick({length_mm, 0}, budget, state);
  }
  vessel::TubeVessel phantom = vessel::MakeTyPhantom();
  const ClearanceField& field = *phantom.field;
  WireModel model;
  WallModel wall{0.01, 1};
  PaperSettings settings;
  WireState state;
};

int CeilDivide(int a, int b) { return (a + b - 1) / b; }

}  // namespace

TEST_CASE("a segment is inserted just before the tip, parallel to the one before (Fig. 1)") {
  const WireModel model = MakeWire({.tip_mm = 4, .max_length_mm = 31});
  std::mt19937 random(1);
  const WireState start = Wander(model, 30, 0.2, random);
  WireState state = start;
  REQUIRE(InsertSegment(model, state));
  CHECK(state.segments() == 31);
  CHECK(state.insertion_mm() == Approx(31));
  for (int i = 0; i < 26; ++i) CHECK(state.tangents()[i] == start.tangents()[i]);
  CHECK(state.tangents()[26] == start.tangents()[25]);
  for (int i = 26; i < 30; ++i) CHECK(state.tangents()[i + 1] == start.tangents()[i]);
  CHECK_FALSE(InsertSegment(model, state));  // at the wire's full length
  REQUIRE(RetractSegment(model, state));
  CHECK(HashState(state) == HashState(start));
}

TEST_CASE("a fully retracted wire is the wire at the start") {
  Case c(PaperCycles::kNone);
  PaperRelaxation relaxation(c.model, c.field, c.wall, c.settings);
  relaxation.Restart(c.state);
  CountedBudget budget(1000);
  const TickReport report = relaxation.Tick({0, 0}, budget, c.state);
  CHECK(report.actions == 80);
  CHECK(c.state.segments() == 0);
  WireState fresh(c.model);
  CHECK(HashState(c.state) == HashState(fresh));
}

TEST_CASE("slices end a PR cycle, then a GR cycle, then the tick: Fig. 10") {
  const int margin = GENERATE(range(1, 8));
  Case c;
  c.settings.physical.margin = margin;
  PaperRelaxation relaxation(c.model, c.field, c.wall, c.settings);
  relaxation.Restart(c.state);
  CountedBudget budget(100000);
  const TickReport report = relaxation.Tick({200, 0}, budget, c.state);
  const int m = 3 + margin;
  const int physical = CeilDivide(80 * 81 / 2, m * (m + 1) / 2);
  REQUIRE(relaxation.geometrical().zeta() > 0);
  const int length = relaxation.geometrical().interval().length();
  const int geometrical = CeilDivide(length, m * (m + 1) / length);
  CHECK(report.updates == 80 * 81 / 2);
  CHECK(report.iterations == physical + geometrical);
  CHECK(report.work == report.iterations);
  CHECK(report.actions == 0);
  CHECK_FALSE(report.budget_spent);
}

TEST_CASE("cycles go on in the next tick where the budget cut them") {
  Case whole;
  Case cut;
  PaperRelaxation one(whole.model, whole.field, whole.wall, whole.settings);
  PaperRelaxation two(cut.model, cut.field, cut.wall, cut.settings);
  one.Restart(whole.state);
  two.Restart(cut.state);
  int work = 0;
  for (int round = 0; round < 3; ++round) {
    CountedBudget budget(100000);
    work += one.Tick({200, 0}, budget, whole.state).work;
  }
  // One work unit per tick gives one slice per tick; every slice is used up.
  for (int k = 0; k < work; ++k) {
    CountedBudget budget(1);
    CHECK(two.Tick({200, 0}, budget, cut.state).work == 1);
  }
  CHECK(HashState(cut.state) == HashState(whole.state));
}

TEST_CASE("an action interrupts a cycle, which then starts again") {
  const int slices = GENERATE(5, 91);  // within the PR cycle, within the GR cycle
  Case c;
  PaperRelaxation relaxation(c.model, c.field, c.wall, c.settings);
  relaxation.Restart(c.state);
  CountedBudget some(slices);
  CHECK(relaxation.Tick({200, 0}, some, c.state).budget_spent);
  CHECK(relaxation.geometrical().active() == (slices == 91));

  CountedBudget action(1);
  const TickReport acted = relaxation.Tick({202.5, 0}, action, c.state);
  CHECK(acted.actions == 1);
  CHECK(acted.iterations == 0);
  CHECK_FALSE(relaxation.geometrical().active());
  CHECK(c.state.segments() == 81);
  CountedBudget rest(100000);
  const TickReport after = relaxation.Tick({202.5, 0}, rest, c.state);
  CHECK(after.updates == 81 * 82 / 2);
}

TEST_CASE("actions come first, and less than a segment is carried") {
  Case c;
  PaperRelaxation relaxation(c.model, c.field, c.wall, c.settings);
  relaxation.Restart(c.state);
  CountedBudget three(3);
  TickReport report = relaxation.Tick({214.25, 0.1}, three, c.state);
  CHECK(report.actions == 3);
  CHECK(report.iterations == 0);
  CHECK(report.budget_spent);
  CHECK(report.carried[0].insertion_mm == Approx(6.75));
  CountedBudget more(4);
  report = relaxation.Tick({214.25, 0.1}, more, c.state);
  CHECK(report.actions == 3);  // two segments and a rotation
  CHECK(report.iterations == 1);
  CHECK(report.carried[0].insertion_mm == Approx(1.75));
  CHECK(c.state.rotation_rad() == 0.1);
}

TEST_CASE("the workflow gives the same bits for the same work") {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> units(0, 40);
  std::vector<int> granted;
  std::uint64_t first = 0;
  for (int run = 0; run < 2; ++run) {
    Case c(PaperCycles::kGeometrical, 100);
    PaperRelaxation relaxation(c.model, c.field, c.wall, c.settings);
    relaxation.Restart(c.state);
    for (int k = 0; k < 60; ++k) {
      // The first run uses random budgets, as with a clock; the second repeats the work of the
      // first.
      CountedBudget budget(run == 0 ? units(random) : granted[k]);
      const InstrumentPoses target{100 + 1.25 * k - (k > 40 ? 2.5 * (k - 40) : 0.0), 0.05 * k};
      const TickReport report = relaxation.Tick(target, budget, c.state);
      if (run == 0) granted.push_back(report.work);
      if (run == 1) CHECK(report.work == granted[k]);
    }
    if (run == 0) first = HashState(c.state);
    if (run == 1) CHECK(HashState(c.state) == first);
  }
}

TEST_CASE("settings leave cycles out") {
  Case none(PaperCycles::kNone);
  PaperRelaxation tip_only(none.model, none.field, none.wall, none.settings);
  tip_only.Restart(none.state);
  CountedBudget budget(100000);
  CHECK(tip_only.Tick({200, 0}, budget, none.state).work == 0);

  Case physical(PaperCycles::kPhysical);
  PaperRelaxation without(physical.model, physical.field, physical.wall, physical.settings);
  without.Restart(physical.state);
  const TickReport report = without.Tick({200, 0}, budget, physical.state);
  CHECK(report.updates == 3240);
  CHECK(report.iterations == CeilDivide(3240, 36));
  CHECK(without.geometrical().zeta() == 0);
}

TEST_CASE("cycles bring the wire nearer to equilibrium") {
  Case c;
  PaperRelaxation relaxation(c.model, c.field, c.wall, c.settings);
  relaxation.Restart(c.state);
  const double at_first = relaxation.Current().energy_mJ;
  TickReport report;
  for (int k = 0; k < 30; ++k) {
    CountedBudget budget(100000);
    report = relaxation.Tick({200, 0}, budget, c.state);
  }
  CHECK(report.energy_mJ < 0.95 * at_first);
  CHECK(report.max_penetration_mm < 0.1);
}

TEST_CASE("a tick does not allocate") {
  Case c;
  PaperRelaxation relaxation(c.model, c.field, c.wall, c.settings);
  relaxation.Restart(c.state);
  CountedBudget budget(100000);
  const std::size_t before = AllocationCount();
  for (int k = 0; k < 5; ++k) {
    relaxation.Tick({200.0 + 5 * k, 0.3 * k}, budget, c.state);
    relaxation.Tick({200.0 + 5 * k, 0.3 * k}, budget, c.state);
  }
  relaxation.Tick({10, 0}, budget, c.state);
  CHECK(AllocationCount() == before);
}

TEST_CASE("the predecessor feeds at the base in small steps, each with a cycle") {
  const WireModel model =
      MakeWire({.max_length_mm = 70, .law = BendingLaw::kG2, .sheath = {{20, 0, 0}, {0, 1, 0}}});
  const Torus field(Side::kInside, 20, 2);
  const WallModel wall{0.01, 1};
  PredecessorRelaxation relaxation(model, field, wall, {});
  WireState state = LayStraight(model, 3);
  relaxation.Restart(state);
  CountedBudget budget(1000);
  TickReport report = relaxation.Tick({4, 0}, budget, state);
  CHECK(report.actions == 11);
  CHECK(report.updates == 5 * 6 + 6 * 10);  // n = 3 until the first segment is 1.5 mm long
  CHECK(state.insertion_mm() == 4);
  CHECK(report.carried[0].insertion_mm == 0);
  for (int mm = 5; mm <= 30; ++mm) report = relaxation.Tick({1.0 * mm, 0}, budget, state);
  CHECK(report.max_penetration_mm < 0.5);
  CHECK(report.energy_mJ < 1e-3);
  CHECK(state.nodes().back()[0] < 15);  // it follows the bend
}

TEST_CASE("the predecessor's cycle takes the signed denominator of (16), unbounded") {
  const WireModel model = MakeWire({.max_length_mm = 70, .law = BendingLaw::kG2});
  WireState start = WithTangent(model, LayStraight(model, 10), 9, Vector3d(1, 0.3, 0));
  const HalfSpace field({8, 0, 0}, {-1, 0, 0});  // pressed so hard that rho - u.B is negative
  const WallModel wall{0.1, 1};
  const auto cycle = [&](UpdateRule rule) {
    WireState state = start;
    PhysicalRelaxation physical(
        model, field, wall, {.rule = rule, .max_update = std::numeric_limits<double>::infinity()});
    physical.Restart(state);
    physical.ContinueCycle(1000, state);
    return HashState(state);
  };
  WireState state = start;
  PredecessorRelaxation relaxation(model, field, wall, {});
  relaxation.Restart(state);
  CountedBudget budget(1);
  CHECK(relaxation.Tick({10, 0}, budget, state).updates == 55);
  CHECK(HashState(state) == cycle(UpdateRule::kSigned));
  CHECK(HashState(state) != cycle(UpdateRule::kAbsolute));
}

TEST_CASE("fed fast against a wall the predecessor perforates it, the paper's method does not") {
  // Head-on: denominators of (16) become negative, and the sign drives the tip further into the
  // wall.
  const auto press = [](Relaxation& relaxation, const WireModel& model) {
    WireState state = WithTangent(model, LayStraight(model, 12.5), 4, Vector3d(1, 0.03, 0.01));
    relaxation.Restart(state);
    CountedBudget budget(1'000'000);
    double deepest = 0;
    for (int k = 1; k <= 8; ++k) {
      deepest =
          std::max(deepest, relaxation.Tick({12.5 + 2.5 * k, 0}, budget, state).max_penetration_mm);
    }
    return deepest;
  };
  const HalfSpace field({14, 0, 0}, {-1, 0, 0});
  const WallModel wall{0.05, 1};
  const WireModel ours = MakeWire({.segment_mm = 2.5, .max_length_mm = 70, .law = BendingLaw::kG1});
  PaperRelaxation paper(ours, field, wall, {});
  CHECK(press(paper, ours) < 2.5);
  const WireModel theirs =
      MakeWire({.segment_mm = 2.5, .max_length_mm = 70, .law = BendingLaw::kG2});
  PredecessorSettings fast;
  fast.feed_segments = 0.5;
  PredecessorRelaxation predecessor(theirs, field, wall, fast);
  CHECK(press(predecessor, theirs) > 10);
}

}  // namespace torquer::test
