#include "host/simulator/core/newton/newton_relaxation.h"

#include <catch2/catch.hpp>
#include <memory>

#include "host/simulator/core/paper/paper_relaxation.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/invariants.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// A curved tip going round a torus: contacts, snaps and every kind of motion.
struct Bench {
  WireModel model = MakeWire({.segment_mm = 1,
                              .tip_mm = 10,
                              .tip_curvature_1_per_mm = 0.1,
                              .max_length_mm = 90,
                              .sheath = {Vector3d(25, 0, 0), Vector3d::UnitY()}});
  Torus field{Side::kInside, 25, 3};
  WallModel wall;
  std::vector<EnergyTerm*> none;
  std::unique_ptr<Relaxation> relaxation;
  WireState state{model};

  explicit Bench(bool paper = false) {
    wall.stiffness_N_mm2 = 0.02;
    if (paper) {
      wall.points_per_segment = 1;
      relaxation = std::make_unique<PaperRelaxation>(model, field, wall, PaperSettings{});
    } else {
      relaxation = std::make_unique<NewtonRelaxation>(model, field, wall, NewtonSettings{}, none);
    }
    relaxation->Restart(state);
  }
  TickReport Tick(const InstrumentPoses& target, int units) {
    CountedBudget budget(units);
    return relaxation->Tick(target, budget, state);
  }
};

// A hand that feeds, retracts and turns, by small and by large steps.
class Hand {
 public:
  explicit Hand(unsigned seed) : random_(seed) {}
  InstrumentPoses Next() {
    std::uniform_real_distribution<double> uniform(-1, 1);
    const double large = std::abs(uniform(random_)) < 0.1 ? 20 : 0.3;
    target_[0].insertion_mm =
        std::clamp(target_[0].insertion_mm + large * (uniform(random_) + 0.3), -1.0, 91.0);
    target_[0].rotation_rad += large * 0.1 * uniform(random_);
    return target_;
  }

 private:
  std::mt19937 random_;
  InstrumentPoses target_;
};

TEST_CASE("A budget cut at any point leaves a valid wire, and the next tick continues from it") {
  Bench start;
  REQUIRE(start.Tick({40, 0.5}, 100000).converged);
  const InstrumentPoses target{46.3, 1.4};
  Bench whole;
  REQUIRE(whole.Tick({40, 0.5}, 100000).converged);
  const TickReport full = whole.Tick(target, 100000);
  REQUIRE(full.converged);
  REQUIRE(full.work > 20);
  // Under a sanitizer, only every third budget between the ends.
  const auto next = [&](int units) {
    return kUnderSanitizer && units > 3 && units < full.work - 3 ? units + 3 : units + 1;
  };
  for (int units = 0; units <= full.work + 1; units = next(units)) {
    INFO("units " << units);
    Bench cut;
    cut.Tick({40, 0.5}, 100000);
    const std::uint64_t before = HashState(cut.state);
    TickChecker checker(cut.model, cut.field, cut.state);
    const TickReport report = cut.Tick(target, units);
    REQUIRE_THAT(checker.Check(target, report, cut.state, cut.wall.points_per_segment),
                 Catch::Equals(""));
    CHECK(report.work == std::min(units, full.work));
    CHECK(report.budget_spent == (units < full.work));
    if (units == 0) CHECK(HashState(cut.state) == before);
    if (units >= full.work) CHECK(HashState(cut.state) == HashState(whole.state));
    const TickReport rest = cut.Tick(target, 100000);
    CHECK(rest.converged);
    CHECK(rest.carried[0].insertion_mm == 0);
    CHECK(cut.state.rotation_rad() == target[0].rotation_rad);
  }
}

TEST_CASE("The work that was recorded repeats a session to the bit") {
  const bool paper = GENERATE(false, true);
  Bench first(paper);
  Hand hand(31);
  std::mt19937 random(32);
  std::vector<InstrumentPoses> targets;
  std::vector<int> work;
  std::vector<std::uint64_t> hashes;
  for (int k = 0; k < (paper ? 100 : 400); ++k) {
    targets.push_back(hand.Next());
    // Budgets vary as with a clock.
    const int units = std::uniform_int_distribution<int>(0, 30)(random);
    work.push_back(first.Tick(targets.back(), units).work);
    hashes.push_back(HashState(first.state));
  }
  Bench again(paper);
  for (std::size_t k = 0; k < targets.size(); ++k) {
    again.Tick(targets[k], work[k]);
    REQUIRE(HashState(again.state) == hashes[k]);
  }
}

TEST_CASE("After Restart a session repeats to the bit, after any earlier session") {
  Bench bench;
  Hand wild(5);
  for (int k = 0; k < 50; ++k) bench.Tick(wild.Next(), 20);
  bench.state = WireState(bench.model);
  bench.relaxation->Restart(bench.state);
  Bench fresh;
  Hand a(6);
  Hand b(6);
  for (int k = 0; k < 100; ++k) {
    bench.Tick(a.Next(), 25);
    fresh.Tick(b.Next(), 25);
    REQUIRE(HashState(bench.state) == HashState(fresh.state));
  }
}

TEST_CASE("A tick does not allocate") {
  const bool paper = GENERATE(false, true);
  Bench bench(paper);
  Hand hand(41);
  const std::size_t before = AllocationCount();
  for (int k = 0; k < (paper ? 60 : 300); ++k) bench.Tick(hand.Next(), 40);
  CHECK(AllocationCount() == before);
  CHECK(bench.state.segments() > 0);
}

TEST_CASE("Without motion every iteration lowers the energy") {
  Bench bench;
  std::mt19937 random(8);
  bench.Tick({60, 0}, 100000);
  Shake(bench.model, 0.3, random, bench.state);
  bench.relaxation->Restart(bench.state);
  double energy = bench.relaxation->Current().energy_mJ;
  const double at_first = energy;
  for (int k = 0; k < 500; ++k) {
    // One work unit for the search of motion, one for an iteration.
    const TickReport report = bench.Tick({60, 0}, 2);
    CHECK(report.energy_mJ <= energy + 1e-12 * at_first);
    energy = report.energy_mJ;
    if (report.converged) break;
  }
  CHECK(bench.Tick({60, 0}, 2).converged);
  CHECK(energy < 0.2 * at_first);
}

TEST_CASE(
    "Of a wire laid in loops at random, with a curved and turned tip, no step raises energy") {
  std::mt19937 random(88001199);
  const WireModel model = MakeWire(
      {.segment_mm = 2, .tip_mm = 16, .tip_curvature_1_per_mm = 0.15, .max_length_mm = 80});
  const FreeSpace field;
  const WallModel wall;
  const std::vector<EnergyTerm*> none;
  int steps = 0;
  for (int round = 0; round < Rounds(60, 6); ++round) {
    INFO("round " << round);
    NewtonRelaxation relaxation(model, field, wall, {}, none);
    WireState state = Wander(model, 80, 0.8, random);
    state.Rotate(std::uniform_real_distribution<double>(-3, 3)(random));
    relaxation.Restart(state);
    std::vector<AttemptRecord> records;
    relaxation.Record(&records);
    CountedBudget budget(60);
    relaxation.Tick(state.poses(), budget, state);
    for (std::size_t k = 0; k + 1 < records.size(); ++k) {
      // The next record's energy is never larger, whether or not the step was accepted.
      CHECK(records[k + 1].energy_mJ <= records[k].energy_mJ * (1 + 1e-12));
      steps += records[k].accepted;
    }
    // A fresh model of the state gives the energy that the solver reached.
    const double reached_mJ = relaxation.Current().energy_mJ;
    relaxation.Restart(state);
    CHECK(relaxation.Current().energy_mJ == Approx(reached_mJ).epsilon(1e-9).margin(1e-12));
  }
  CHECK(steps > 0);
}

TEST_CASE("The report agrees with the state") {
  Bench bench;
  Hand hand(51);
  TickChecker checker(bench.model, bench.field, bench.state);
  std::vector<EnergyTerm*> none;
  WireMechanics mechanics(bench.model, bench.field, bench.wall, none);
  QuadraticModel fresh = mechanics.MakeQuadraticModel();
  int converged = 0;
  for (int k = 0; k < 500; ++k) {
    const InstrumentPoses target = hand.Next();
    const TickReport report = bench.Tick(target, 30);
    REQUIRE_THAT(checker.Check(target, report, bench.state, 2), Catch::Equals(""));
    mechanics.points().Forget();
    mechanics.BuildModel(bench.state, fresh);
    CHECK(report.energy_mJ == Approx(fresh.energy_mJ).epsilon(1e-9).margin(1e-15));
    CHECK(report.residual == Approx(fresh.residual).epsilon(1e-6).margin(1e-10));
    if (report.converged) CHECK(report.residual <= 1e-6);
    // With budget left the solver has arrived. It has converged or cannot get closer.
    if (!report.budget_spent) CHECK(report.converged == (report.residual <= 1e-6));
    converged += report.converged;
  }
  CHECK(converged > 300);
}

TEST_CASE("A command beyond the wire's ends stops at the end and is not carried") {
  Bench bench;
  const TickReport in = bench.Tick({1e5, 0}, 1000000);
  CHECK(bench.state.insertion_mm() == 90);
  CHECK(in.carried[0].insertion_mm == 0);
  const TickReport out = bench.Tick({-1e5, 0}, 1000000);
  CHECK(bench.state.insertion_mm() == 0);
  CHECK(out.carried[0].insertion_mm == 0);
  CHECK(bench.state.segments() == 0);
  CHECK(out.converged);
  CHECK(HashState(bench.state) == HashState(WireState(bench.model)));
}

TEST_CASE("Out and in again gives the first wire") {
  Bench bench;
  const auto feed = [&](double to) {
    while (bench.state.insertion_mm() != to) {
      const double left = to - bench.state.insertion_mm();
      bench.Tick({bench.state.insertion_mm() + std::clamp(left, -0.25, 0.25), 0}, 100000);
    }
  };
  feed(40);
  const WireState first = bench.state;
  for (int k = 0; k < 3; ++k) {
    feed(0);
    CHECK(HashState(bench.state) == HashState(WireState(bench.model)));
    feed(40);
    CHECK(HashState(bench.state) == HashState(first));
  }
}

TEST_CASE("The tip of a resting wire, fed by hundredths of a millimeter, advances without a jump") {
  // Fed straight into free space, with a curved tip and a load that bends the shaft.
  const WireModel model = MakeWire({.segment_mm = 1, .tip_mm = 8, .tip_curvature_1_per_mm = 0.1});
  const FreeSpace field;
  const WallModel wall;
  EndForce force(Vector3d(0, 0, 2e-5));
  const std::vector<EnergyTerm*> terms{&force};
  NewtonRelaxation relaxation(model, field, wall, {.tolerance = 1e-9}, terms);
  WireState state = LayStraight(model, 15);
  relaxation.Restart(state);
  REQUIRE(Settle(relaxation, {15, 0}, state).converged);
  Vector3d last = state.nodes().back();
  Vector3d last_step = Vector3d::Zero();
  double roughest = 0;
  for (int k = 1; k <= 300; ++k) {
    REQUIRE(Settle(relaxation, {15 + 0.01 * k, 0}, state).converged);
    const Vector3d step = state.nodes().back() - last;
    if (k > 1) roughest = std::max(roughest, (step - last_step).norm());
    last_step = step;
    last = state.nodes().back();
  }
  REQUIRE(state.segments() == 18);  // three splits so far
  INFO("largest difference of two successive steps of the tip " << roughest);
  CHECK(roughest < 0.01);
}

}  // namespace
}  // namespace torquer::test
