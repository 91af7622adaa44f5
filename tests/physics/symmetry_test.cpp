// Invariance tests: the vessel's position and rotation, and the path to equilibrium must not
// matter.
#include <catch2/catch.hpp>
#include <cmath>
#include <utility>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// A field in another frame: q = R p + t.
class Moved final : public AnalyticField {
 public:
  Moved(const ClearanceField& field, const Matrix3d& rotation, const Vector3d& translation)
      : field_(field), rotation_(rotation), translation_(translation) {}
  void EvaluateHessian(const Vector3d& q, ClearanceSample& out) const override {
    ClearanceSample s;
    field_.EvaluateHessian(rotation_.transpose() * (q - translation_), s);
    out.clearance_mm = s.clearance_mm;
    out.gradient = rotation_ * s.gradient;
    out.hessian = rotation_ * s.hessian * rotation_.transpose();
  }

 private:
  const ClearanceField& field_;
  Matrix3d rotation_;
  Vector3d translation_;
};

struct Bench {
  WireModel model;
  WallModel wall;
  std::vector<EnergyTerm*> none;
  NewtonRelaxation relaxation;
  WireState state;

  Bench(const WireParameters& parameters, const ClearanceField& field, double stiffness_N_mm2,
        int points = 2)
      : model(MakeWire(parameters)),
        wall{.stiffness_N_mm2 = stiffness_N_mm2, .points_per_segment = points},
        relaxation(model, field, wall, {.tolerance = 1e-9}, none),
        state(model) {
    relaxation.Restart(state);
  }
};

TEST_CASE("A motion of the vessel moves the wire with it, without other changes") {
  const Torus field(Side::kInside, 30, 3);
  WireParameters parameters{.segment_mm = 1,
                            .tip_mm = 8,
                            .tip_curvature_1_per_mm = 0.08,
                            .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}};
  Bench home(parameters, field, 0.01);
  const Matrix3d rotation =
      Eigen::AngleAxisd(1.1, Vector3d(0.3, -0.8, 0.5).normalized()).toRotationMatrix();
  const Vector3d translation(100, -40, 7);
  const Moved elsewhere(field, rotation, translation);
  parameters.sheath.point_mm = rotation * parameters.sheath.point_mm + translation;
  parameters.sheath.direction = (rotation * parameters.sheath.direction).normalized();
  Bench away(parameters, elsewhere, 0.01);
  // The wire's first normal is chosen in the vessel's frame: this corrects for the different
  // choice.
  const Vector3d normal = rotation * home.model.sheath_normal();
  const double offset =
      std::atan2(normal.dot(away.model.sheath().direction.cross(away.model.sheath_normal())),
                 normal.dot(away.model.sheath_normal()));
  for (const double insertion : {10.0, 25.0, 40.0}) {
    REQUIRE(Settle(home.relaxation, {insertion, 0.4}, home.state).converged);
    REQUIRE(Settle(away.relaxation, {insertion, 0.4 + offset}, away.state).converged);
    REQUIRE(home.relaxation.Current().max_penetration_mm > 1e-6);
    double largest = 0;
    for (std::size_t i = 0; i < home.state.nodes().size(); ++i) {
      largest = std::max(
          largest, (rotation * home.state.nodes()[i] + translation - away.state.nodes()[i]).norm());
    }
    INFO("insertion " << insertion);
    CHECK(largest < 1e-5);
    CHECK(away.relaxation.Current().energy_mJ ==
          Approx(home.relaxation.Current().energy_mJ).epsilon(1e-9));
  }
}

TEST_CASE("A solution is re-solved in no iterations and stays the same to the bit") {
  const Torus field(Side::kInside, 30, 3);
  Bench bench({.tip_mm = 8,
               .tip_curvature_1_per_mm = 0.08,
               .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}},
              field, 0.01);
  REQUIRE(Settle(bench.relaxation, {33.3, 0.5}, bench.state).converged);
  const std::uint64_t hash = HashState(bench.state);
  CountedBudget budget(100);
  const TickReport again = bench.relaxation.Tick({33.3, 0.5}, budget, bench.state);
  CHECK(again.iterations == 0);
  CHECK(again.converged);
  CHECK(HashState(bench.state) == hash);
}

// Motion of the tip from one segment length to half of it, from 2 mm down to `finest_mm`. The value
// is the root mean square over wires that end at different places of a segment.
std::vector<double> TipMotions(double from_mm, int points, double finest_mm) {
  const Torus field(Side::kInside, 30, 3);
  constexpr int kWires = Rounds(8, 2);
  std::vector<Vector3d> coarser;
  std::vector<double> motions;
  for (double lambda = 2; lambda >= finest_mm; lambda /= 2) {
    std::vector<Vector3d> tips;
    for (int k = 0; k < kWires; ++k) {
      // The wall is so hard that it yields by less than 1e-6 mm: the segments cause the rest.
      Bench bench({.segment_mm = lambda,
                   .max_length_mm = 130,
                   .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}},
                  field, 1000, points);
      REQUIRE(
          Settle(bench.relaxation, {from_mm + 2.0 * k / (kWires - 1), 0}, bench.state).arrived());
      REQUIRE(bench.relaxation.Current().residual < 1e-8);
      REQUIRE(bench.relaxation.Current().max_penetration_mm > 0);
      tips.push_back(bench.state.nodes().back());
    }
    if (!coarser.empty()) {
      double sum = 0;
      for (std::size_t k = 0; k < tips.size(); ++k) sum += (tips[k] - coarser[k]).squaredNorm();
      motions.push_back(std::sqrt(sum / kWires));
    }
    coarser = std::move(tips);
  }
  return motions;
}

TEST_CASE("Finer segments change a wire that rests on its tip to second order") {
  const int points = GENERATE(2, 4);
  const std::vector<double> motions = TipMotions(43, points, kUnderSanitizer ? 0.5 : 0.125);
  REQUIRE(motions.size() == (kUnderSanitizer ? 2 : 4));
  for (std::size_t k = 1; k < motions.size(); ++k) {
    const double order = std::log2(motions[k - 1] / motions[k]);
    INFO(points << " points a segment, halving " << k << ": " << motions[k] << " mm, order "
                << order);
    CHECK(order == Approx(2).margin(0.1));
  }
}

TEST_CASE("Finer segments change a wire that also touches between to first order") {
  // Only quadrature points can touch. If the wall bends the wire between two of them, the contact
  // is up to half a distance too far.
  const int halvings = kUnderSanitizer ? 2 : 4;
  const std::vector<double> motions = TipMotions(100, 2, 2 / std::pow(2, halvings));
  REQUIRE(static_cast<int>(motions.size()) == halvings);
  INFO(motions.front() << " .. " << motions.back() << " mm");
  CHECK(std::log2(motions.front() / motions.back()) / (halvings - 1) > 0.9);
  CHECK(motions.back() < 0.024 / (1 << (halvings - 1)));
}

TEST_CASE("Both methods reach one minimum where the paper's method can stop") {
  // Straight tip, and a wall soft enough that k lambda^3 (contacts) < 4 EI / lambda.
  const Torus field(Side::kInside, 30, 0.4);
  const WireParameters parameters{.max_length_mm = 60,
                                  .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}};
  const double stiffness = 2e-4;
  Bench newton(parameters, field, stiffness, 1);
  REQUIRE(Settle(newton.relaxation, {25, 0}, newton.state).converged);
  const PointSet& points = newton.relaxation.Current().points;
  int contacts = 0;
  for (const std::uint8_t touches : points.touches) contacts += touches;
  REQUIRE(contacts > 3);
  REQUIRE(stiffness * contacts < 4 * parameters.rigidity_N_mm2);

  // Physical Relaxation stays at the minimum that Newton found.
  PhysicalRelaxation physical(newton.model, field, newton.wall, {});
  WireState state = newton.state;
  physical.Restart(state);
  for (int cycle = 0; cycle < 5; ++cycle) physical.ContinueCycle(1 << 30, state);
  CHECK(LargestDistance(state, newton.state) < 1e-6);

  // After a perturbation it returns to the minimum.
  std::mt19937 random(23);
  Shake(newton.model, 0.01, random, state);
  REQUIRE(LargestDistance(state, newton.state) > 0.02);
  physical.Restart(state);
  for (int cycle = 0; cycle < 3000; ++cycle) physical.ContinueCycle(1 << 30, state);
  CHECK(LargestDistance(state, newton.state) < 1e-3);
}

}  // namespace
}  // namespace torquer::test
