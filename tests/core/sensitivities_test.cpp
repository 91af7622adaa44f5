// Derivatives that are carried along a motion: same states, any budgets, no heap, linear laws.
#include "host/simulator/core/newton/sensitivities.h"

#include <array>
#include <catch2/catch.hpp>
#include <memory>
#include <random>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

WireModel WireInTorus(double rigidity_N_mm2, bool twists) {
  return MakeWire({.rigidity_N_mm2 = rigidity_N_mm2,
                   .torsional_rigidity_N_mm2 = twists ? 2 * rigidity_N_mm2 : 0,
                   .radius_mm = 0.2,
                   .tip_mm = 8,
                   .tip_curvature_1_per_mm = 0.08,
                   .max_length_mm = 50,
                   .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}});
}

// A wire with friction in a torus, and all that it needs.
struct Instance {
  static constexpr double kRigidity = 0.01;
  static constexpr double kMu = 0.2;

  InstrumentStack stack;
  WallModel wall{.stiffness_N_mm2 = 0.05};
  effects::Friction friction;
  std::vector<EnergyTerm*> terms{&friction};

  Instance(double rigidity_N_mm2, double mu, bool twists)
      : stack(std::vector<WireModel>{WireInTorus(rigidity_N_mm2, twists)}),
        friction(mu, 0.005, Context()) {}
  effects::EffectContext Context() const {
    effects::EffectContext context{stack.empty_rod(), wall};
    context.instruments.resize(1);
    context.stack = &stack;
    return context;
  }
};

// The derivatives of such a wire by its rigidity and by the coefficient of friction.
struct Tracked {
  static constexpr double kStep = 3e-6;

  Torus torus{Side::kInside, 30, 3};
  Instance wire;
  std::array<Instance, 4> others;
  std::vector<std::unique_ptr<ShadowWire>> shadows;
  std::unique_ptr<Relaxation> relaxation;
  WireState state;
  Sensitivities sensitivities;

  explicit Tracked(bool twists, double tolerance = 1e-6)
      : wire(Instance::kRigidity, Instance::kMu, twists),
        others{Instance(Instance::kRigidity * (1 + kStep), Instance::kMu, twists),
               Instance(Instance::kRigidity * (1 - kStep), Instance::kMu, twists),
               Instance(Instance::kRigidity, Instance::kMu * (1 + kStep), twists),
               Instance(Instance::kRigidity, Instance::kMu * (1 - kStep), twists)},
        relaxation(MakeNewtonRelaxation(wire.stack, torus, wire.wall, {.tolerance = tolerance},
                                        wire.terms)),
        state(wire.stack.empty_rod(), 1),
        sensitivities(relaxation->rods()[0]) {
    for (Instance& other : others) {
      shadows.push_back(std::make_unique<ShadowWire>(other.stack, torus, other.wall, other.terms));
    }
    sensitivities.Add(*shadows[0], *shadows[1], kStep * Instance::kRigidity);
    sensitivities.Add(*shadows[2], *shadows[3], kStep * Instance::kMu);
  }
};

// Random motion, each target in one tick or in many small ones. Returns the hash of the last state.
std::uint64_t Stray(Tracked& tracked, unsigned seed, bool cut) {
  std::mt19937 random(seed);
  std::mt19937 random_units(5);
  for (int round = 0; round < 3; ++round) {
    InstrumentPoses target(1);
    target[0] = {std::uniform_real_distribution<double>(10, 45)(random),
                 std::uniform_real_distribution<double>(-2, 2)(random)};
    TickReport report;
    int done = 0;
    do {
      std::uniform_int_distribution<int> units(1, 9);
      CountedBudget budget(cut ? units(random_units) : 100000);
      report = tracked.relaxation->Tick(target, budget, tracked.state);
      done += report.work;
    } while (report.budget_spent && done < 100000);
    if (!report.arrived()) FAIL("did not arrive");
  }
  return tracked.relaxation->Hash(HashState(tracked.state));
}

}  // namespace

TEST_CASE("Following a motion in any budgets changes no bit of it and allocates nothing") {
  const unsigned seed = GENERATE(range(0U, static_cast<unsigned>(Rounds(6, 3))));
  CAPTURE(seed);
  const bool twists = seed % 2 == 1;
  Tracked alone(twists);
  alone.relaxation->Restart(alone.state);
  const std::uint64_t expected = Stray(alone, seed, false);
  std::array<std::vector<Vector3d>, 2> found;
  for (const bool cut : {false, true}) {
    Tracked tracked(twists);
    tracked.relaxation->Follow(&tracked.sensitivities);
    tracked.relaxation->Restart(tracked.state);
    const std::size_t allocated = AllocationCount();
    CHECK(Stray(tracked, seed, cut) == expected);
    CHECK(AllocationCount() == allocated);
    for (const std::size_t parameter : {0U, 1U}) {
      CHECK(tracked.sensitivities.unknown(parameter) == Sensitivities::Unknown::kNone);
    }
    found[cut ? 1 : 0] = tracked.sensitivities.nodes_mm(1);
  }
  CHECK(found[0] == found[1]);
}

TEST_CASE("Derivatives of a part that the budget interrupts are not known until it ends") {
  Tracked tracked(false);
  tracked.relaxation->Follow(&tracked.sensitivities);
  tracked.relaxation->Restart(tracked.state);
  InstrumentPoses target(1);
  target[0].insertion_mm = 30;
  CountedBudget few(20);
  REQUIRE(tracked.relaxation->Tick(target, few, tracked.state).budget_spent);
  CHECK(tracked.sensitivities.unknown(0) == Sensitivities::Unknown::kNotAtRest);
  CountedBudget enough(100000);
  REQUIRE(tracked.relaxation->Tick(target, enough, tracked.state).converged);
  CHECK(tracked.sensitivities.unknown(0) == Sensitivities::Unknown::kNone);
  // Once lost, they stay lost, because friction remembers the way.
  tracked.sensitivities.Lose();
  target[0].insertion_mm = 31;
  REQUIRE(tracked.relaxation->Tick(target, enough, tracked.state).converged);
  CHECK(tracked.sensitivities.unknown(0) == Sensitivities::Unknown::kHistoryLost);
  tracked.relaxation->Restart(tracked.state);
  CHECK(tracked.sensitivities.unknown(0) == Sensitivities::Unknown::kNone);
}

TEST_CASE("A derivative is the shadows' difference, and no parameter acts on an empty state") {
  Tracked tracked(false, 1e-9);
  tracked.relaxation->Follow(&tracked.sensitivities);
  tracked.relaxation->Restart(tracked.state);
  CHECK(tracked.sensitivities.nodes_mm(0) == std::vector<Vector3d>{Vector3d::Zero()});
  InstrumentPoses target(1);
  target[0].insertion_mm = 35;
  CountedBudget budget(100000);
  REQUIRE(tracked.relaxation->Tick(target, budget, tracked.state).converged);
  for (const std::size_t k : {0U, 1U}) {
    const Vector3d expected = (tracked.sensitivities.more(k).state().tip() -
                               tracked.sensitivities.less(k).state().tip()) /
                              tracked.sensitivities.spread(k);
    const Vector3d& found = tracked.sensitivities.nodes_mm(k).back();
    CHECK(found.norm() > 0);
    CHECK((found - expected).norm() < 1e-4 * found.norm());
    CHECK(tracked.sensitivities.nodes_mm(k).size() == tracked.state.nodes().size());
  }
}

}  // namespace torquer::test
