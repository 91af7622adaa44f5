// O(n) Newton step, compared with a dense one from a finite-difference Hessian.
#include "host/simulator/core/newton/riccati_sweep.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "tests/support/analytic_fields.h"
#include "tests/support/dense_newton.h"
#include "tests/support/finite_differences.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

struct Chain {
  WireModel model;
  const ClearanceField& field;
  WallModel wall;
  std::vector<EnergyTerm*> terms;
  WireState state;
  WireMechanics mechanics;
  QuadraticModel quadratic;
  RiccatiSweep<BendStage> sweep;

  Chain(const WireParameters& parameters, const ClearanceField& vessel, const WallModel& soft,
        std::vector<EnergyTerm*> more)
      : model(MakeWire(parameters)),
        field(vessel),
        wall(soft),
        terms(std::move(more)),
        state(model),
        mechanics(model, field, wall, terms),
        quadratic(mechanics.MakeQuadraticModel()),
        sweep(model.max_segments()) {}

  int unknowns() const { return 2 * state.segments(); }

  double Energy(const Eigen::VectorXd& xi) {
    QuadraticModel there = mechanics.MakeQuadraticModel();
    mechanics.points().Forget();
    mechanics.BuildGradient(Stepped(model, state, Steps(xi)), there);
    return there.energy_mJ;
  }

  Eigen::MatrixXd DenseHessian() {
    return HessianOf([this](const Eigen::VectorXd& xi) { return Energy(xi); },
                     Eigen::VectorXd::Zero(unknowns()), 3e-3);
  }

  Eigen::VectorXd SweptStep(double& predicted) {
    std::vector<RiccatiSweep<BendStage>::Control> step;
    std::vector<double> spin;
    std::vector<Vector3d> displacement;
    predicted = sweep.Step(model, state, quadratic, step, spin, displacement);
    Eigen::VectorXd x(unknowns());
    for (int i = 0; i < state.segments(); ++i) x.segment<2>(2 * i) = step[i];
    return x;
  }
};

TEST_CASE("The sweep's step solves the dense Newton system") {
  // Every block matters: contact, a curved and turned tip, an odd first segment, an end force.
  const double weight = GENERATE(0.1, 10.0);
  const int points = GENERATE(1, 3);
  const Torus field(Side::kInside, 20, 2);
  EndForce force(Vector3d(1e-4, 2e-4, 3e-4));
  Chain chain({.segment_mm = 1.3,
               .tip_mm = 5.2,
               .tip_curvature_1_per_mm = 0.1,
               .sheath = {Vector3d(21.8, 0, 0), Vector3d::UnitY()}},
              field, {.stiffness_N_mm2 = 2e-3, .points_per_segment = points}, {&force});
  std::mt19937 random(5);
  std::vector<Vector3d> arc;  // along the outer wall
  for (double a = 0.02; a < 1; a += 0.02) arc.emplace_back(22 * std::cos(a), 22 * std::sin(a), 0.2);
  chain.state = WireState::Along(chain.model, arc, {15.1, 0});
  Shake(chain.model, 0.03, random, chain.state);
  chain.state.Rotate(0.9);
  chain.state.UpdateFrames(chain.model);
  chain.mechanics.BuildModel(chain.state, chain.quadratic);
  // Deep enough to matter, and shallow enough that the wall's curvature is not limited.
  REQUIRE(chain.quadratic.max_penetration_mm > 0.1);
  REQUIRE(chain.quadratic.max_penetration_mm < 0.9);

  RiccatiSweep<BendStage> sweep(chain.model.max_segments());
  CheckSweepIsDense(sweep, chain.model, chain.state, chain.quadratic, chain.DenseHessian(),
                    Eigen::VectorXd::Constant(chain.unknowns(), 6.35e-3), weight);
}

TEST_CASE("The sweep takes a Hessian for positive definite exactly where it is") {
  // Compressed column: its smallest eigenvalue crosses zero at the buckling load. Without friction
  // and wall the dense Hessian is exact to rounding.
  const FreeSpace field;
  EndForce force(Vector3d::Zero());
  Chain chain({.segment_mm = 1, .rigidity_N_mm2 = 1}, field, {}, {&force});
  chain.state = LayStraight(chain.model, 12);
  int agreed[2] = {0, 0};
  for (double load = 0; load < 0.05; load += kUnderSanitizer ? 0.00474 : 0.00237) {
    force.SetForce(Vector3d(-load, 0, 0));
    chain.mechanics.BuildModel(chain.state, chain.quadratic);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(chain.DenseHessian());
    const double smallest = eigen.eigenvalues()[0];
    if (std::abs(smallest) < 1e-6) continue;
    INFO("load " << load << " smallest eigenvalue " << smallest);
    CHECK(chain.sweep.Factor(chain.model, chain.state, chain.quadratic, 0) == (smallest > 0));
    ++agreed[smallest > 0];
  }
  CHECK(agreed[0] > 3);
  CHECK(agreed[1] > 3);
}

TEST_CASE("A change of loads near the sheath reuses the distal sweep, to the bit") {
  const Cylinder field(Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), 1.5);
  Chain chain({.segment_mm = 0.8}, field, {.stiffness_N_mm2 = 1e-2}, {});
  std::mt19937 random(3);
  chain.state = Wander(chain.model, 70, 0.3, random);
  chain.mechanics.BuildModel(chain.state, chain.quadratic);
  const auto near = chain.quadratic.springs.size();
  REQUIRE(near > 20);
  const double proximal = 1e4;
  std::vector<std::uint8_t> active(near, 1);
  chain.mechanics.SumActiveLoads(chain.state, active, chain.quadratic);
  REQUIRE(chain.sweep.Factor(chain.model, chain.state, chain.quadratic, proximal));
  // From near the tip, where everything must be repeated, to the sheath.
  for (std::size_t k = near; k-- > 0;) {
    active[k] = !active[k];
    chain.mechanics.SumActiveLoads(chain.state, active, chain.quadratic);
    const int segment = chain.quadratic.points.near[k] / chain.quadratic.points.per_segment;
    REQUIRE(chain.sweep.Refactor(chain.model, chain.state, chain.quadratic, proximal, segment));
    double predicted = 0;
    const Eigen::VectorXd step = chain.SweptStep(predicted);
    RiccatiSweep<BendStage> whole(chain.model.max_segments());
    REQUIRE(whole.Factor(chain.model, chain.state, chain.quadratic, proximal));
    std::swap(whole, chain.sweep);
    double expected = 0;
    CHECK(chain.SweptStep(expected) == step);
    CHECK(predicted == expected);
    std::swap(whole, chain.sweep);
  }
}

TEST_CASE("A step from far away decreases the energy at first order as predicted") {
  const Cylinder field(Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), 1.5);
  Chain chain({.segment_mm = 0.8}, field, {.stiffness_N_mm2 = 1e-2}, {});
  std::mt19937 random(17);
  chain.state = Wander(chain.model, 30, 0.4, random);
  chain.mechanics.BuildModel(chain.state, chain.quadratic);
  double proximal = 1e-4;
  while (!chain.sweep.Factor(chain.model, chain.state, chain.quadratic, proximal)) proximal *= 10;
  double predicted = 0;
  const Eigen::VectorXd step = chain.SweptStep(predicted);
  CHECK(predicted > 0);
  const double small = 1e-6 / step.norm();
  const double slope = (chain.Energy(small * step) - chain.Energy(-small * step)) / (2 * small);
  CHECK(slope == Approx(-2 * predicted).epsilon(1e-5));
}

}  // namespace
}  // namespace torquer::test
