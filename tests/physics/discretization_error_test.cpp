// Discretization error that a wire reports, compared with finer segments.
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// Constant load per length, N/mm.
class Weight final : public EnergyTerm {
 public:
  explicit Weight(const Vector3d& load_N_mm) : load_N_mm_(load_N_mm) {}
  void Begin(const PointSet&) override {}
  double Add(const PointSet& points, PointDerivatives& out) const override {
    double energy = 0;
    for (int q = 0; q < points.size(); ++q) {
      const auto p = static_cast<std::size_t>(q);
      out.TouchGradient(q);
      out.gradient[p] -= points.weight_mm[p] * load_N_mm_;
      energy -= points.weight_mm[p] * load_N_mm_.dot(points.position[p]);
    }
    return energy;
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

 private:
  const Vector3d load_N_mm_;
};

// Empty term that counts as dissipative.
class LostWork final : public EnergyTerm {
 public:
  void Begin(const PointSet&) override {}
  bool Dissipates() const override { return true; }
  double Add(const PointSet&, PointDerivatives&) const override { return 0; }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }
};

struct Settled {
  WireModel model;
  WallModel wall{.points_per_segment = 2};
  std::vector<EnergyTerm*> terms;
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  Settled(const WireParameters& parameters, double length_mm, std::vector<EnergyTerm*> loads,
          const ClearanceField& field)
      : model(MakeWire(parameters)),
        terms(std::move(loads)),
        relaxation(MakeNewtonRelaxation(model, field, wall,
                                        {.tolerance = 1e-9, .tolerance_mm = 1e-7}, terms)),
        state(LayStraight(model, length_mm)) {
    relaxation->Restart(state);
    REQUIRE(Settle(*relaxation, {length_mm, 0}, state, 300).converged);
  }
  double ErrorMm() { return relaxation->DiscretizationErrorMm(state); }
};

constexpr double kFinest = 0.03125;

// Largest distance of its nodes from the same material of a much finer wire.
double TrueError(const Settled& coarse, const Settled& fine) {
  const int ratio = static_cast<int>(std::lround(coarse.model.segment_mm() / kFinest));
  double largest = 0;
  for (int from_tip = 0; from_tip < coarse.state.segments(); ++from_tip) {
    const auto at = static_cast<std::size_t>(coarse.state.segments() - from_tip);
    const auto same = static_cast<std::size_t>(fine.state.segments() - ratio * from_tip);
    largest = std::max(largest, (coarse.state.nodes()[at] - fine.state.nodes()[same]).norm());
  }
  return largest;
}

struct Case {
  const char* name;
  double length_mm;
  double curvature_1_per_mm;
  Vector3d end_N;
  Vector3d weight_N_mm;
  BendingLaw law = BendingLaw::kExact;
  // A curved wire bent out of its plane also turns its rest shape, which the estimate leaves out.
  bool turns = false;
};

TEST_CASE("In free space the estimate is the motion by finer segments") {
  constexpr double kRigidity = 2.5;
  const double unit_N = kRigidity / (40 * 40);
  const Vector3d none = Vector3d::Zero();
  const Case c =
      GENERATE_COPY(Case{"elastica", 40, 0, Vector3d(0, 2 * unit_N, 0), none},
                    Case{"far bent", 40.3, 0, Vector3d(0, 10 * unit_N, 0), none},
                    Case{"g1", 40, 0, Vector3d(0, 4 * unit_N, 0), none, BendingLaw::kG1},
                    Case{"g2", 40.8, 0, Vector3d(0, 4 * unit_N, 0), none, BendingLaw::kG2},
                    Case{"circle", 60, 0.05, none, none},
                    Case{"circle pulled out of its plane", 60.6, 0.05,
                         Vector3d(unit_N, 0, 0.7 * unit_N), none, BendingLaw::kExact, true},
                    Case{"weight", 50.4, 0, none, Vector3d(0, 0, -unit_N / 10)},
                    Case{"all", 50.9, 0.03, Vector3d(0, unit_N, unit_N),
                         Vector3d(unit_N / 20, 0, -unit_N / 10), BendingLaw::kExact, true});
  INFO(c.name);
  EndForce force(c.end_N);
  Weight weight(c.weight_N_mm);
  const FreeSpace field;
  const auto settled = [&](double segment_mm) {
    return Settled({.segment_mm = segment_mm,
                    .rigidity_N_mm2 = kRigidity,
                    .tip_mm = c.curvature_1_per_mm == 0 ? 0 : 1e4,
                    .tip_curvature_1_per_mm = c.curvature_1_per_mm,
                    .law = c.law},
                   c.length_mm, {&force, &weight}, field);
  };
  const Settled fine = settled(kFinest);
  double before = 0;
  for (const double segment_mm : {2.0, 1.0, 0.5, 0.25}) {
    Settled coarse = settled(segment_mm);
    const double truth = TrueError(coarse, fine);
    const double estimate = coarse.ErrorMm();
    CAPTURE(segment_mm, truth, estimate);
    CHECK(truth > 1e-5);
    // The finest wire has an error itself: 1.6 % of that at 0.25 mm.
    if (c.turns) {
      CHECK(estimate > truth / 2);
      CHECK(estimate < truth * 2);
    } else {
      CHECK(estimate == Approx(truth).epsilon(0.1));
    }
    if (before > 0) CHECK(before / estimate == Approx(4).epsilon(c.turns ? 0.3 : 0.15));
    before = estimate;
  }
}

TEST_CASE("The estimate does not change the wire, takes no heap and is repeatable") {
  EndForce force(Vector3d(0, 1e-3, 0));
  const FreeSpace field;
  Settled once({.segment_mm = 1, .rigidity_N_mm2 = 0.5, .max_length_mm = 80}, 40, {&force}, field);
  Settled asked({.segment_mm = 1, .rigidity_N_mm2 = 0.5, .max_length_mm = 80}, 40, {&force}, field);
  const std::size_t allocated = AllocationCount();
  for (int k = 1; k <= 60; ++k) {
    CountedBudget first(3);
    CountedBudget second(3);
    once.relaxation->Tick({40 + 0.3 * k, 0.1 * k}, first, once.state);
    asked.relaxation->Tick({40 + 0.3 * k, 0.1 * k}, second, asked.state);
    const double error_mm = asked.ErrorMm();
    if (!(asked.ErrorMm() == error_mm || std::isnan(error_mm))) FAIL("another answer");
  }
  CHECK(AllocationCount() == allocated);
  CHECK(HashState(once.state) == HashState(asked.state));
  CHECK(once.relaxation->Hash(1) == asked.relaxation->Hash(1));
}

TEST_CASE("An unknown estimate is reported as unknown") {
  const FreeSpace free;
  EndForce force(Vector3d(0, 1e-3, 0));
  LostWork lost;
  const WireParameters plain{.segment_mm = 1, .rigidity_N_mm2 = 0.5};
  CHECK(Settled(plain, 40, {&force}, free).ErrorMm() > 0);
  CHECK(std::isnan(Settled(plain, 40, {&force, &lost}, free).ErrorMm()));
  CHECK(
      std::isnan(Settled({.segment_mm = 1, .rigidity_N_mm2 = 0.5, .torsional_rigidity_N_mm2 = 0.4},
                         40, {&force}, free)
                     .ErrorMm()));
  const HalfSpace wall(Vector3d(0, 2, 0), -Vector3d::UnitY());
  CHECK(std::isnan(Settled(plain, 40, {&force}, wall).ErrorMm()));
  CHECK(Settled(plain, 0.2, {}, free).ErrorMm() == 0);
}

}  // namespace
}  // namespace torquer::test
