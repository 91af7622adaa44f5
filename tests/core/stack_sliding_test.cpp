// Test of sliding: a wire drawn through a resting catheter must not change the catheter's shape.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// Two posts on opposite sides: an instrument between them bends to and fro.
class TwoPosts final : public study::AnalyticField {
 public:
  void EvaluateHessian(const Vector3d& p, ClearanceSample& out) const override {
    ClearanceSample second;
    first_.EvaluateHessian(p, out);
    second_.EvaluateHessian(p, second);
    if (second.clearance_mm < out.clearance_mm) out = second;
  }

 private:
  Cylinder first_{Side::kOutside, Vector3d(22, -17, 0), Vector3d::UnitZ(), 20};
  Cylinder second_{Side::kOutside, Vector3d(50, 19, 0), Vector3d::UnitZ(), 20};
};

// A catheter between the posts, held by friction, with a straight wire that reaches into the open.
// The catheter contains the same wire wherever the wire's tip is.
struct DrawnThrough {
  static constexpr double kInside = 65.3;
  static constexpr double kBeyond = 8;

  TwoPosts field;
  WallModel wall;
  InstrumentStack stack;
  effects::Friction friction;
  std::vector<EnergyTerm*> terms{&friction};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  static std::vector<WireModel> Both(double segment_mm) {
    std::vector<WireModel> both;
    both.push_back(MakeWire({.segment_mm = segment_mm,
                             .rigidity_N_mm2 = 0.05,
                             .radius_mm = 0.2,
                             .max_length_mm = 120}));
    both.push_back(MakeWire(
        {.segment_mm = segment_mm, .rigidity_N_mm2 = 0.5, .radius_mm = 0.5, .max_length_mm = 120}));
    return both;
  }
  effects::EffectContext Context() const {
    effects::EffectContext context{stack.rod(), wall};
    context.instruments.resize(2);
    return context;
  }
  DrawnThrough(double segment_mm, int points, double mu)
      : wall{.points_per_segment = points},
        stack(Both(segment_mm)),
        friction(mu, 0.005, Context()),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {}, terms)),
        state(stack.rod(), 2) {
    relaxation->Restart(state);
    DrawTo(0);
  }
  // Moves the wire's tip to `way_mm` beyond its start.
  void DrawTo(double way_mm) {
    const InstrumentPoses target{{kInside + kBeyond + way_mm, 0}, {kInside, 0}};
    const TickReport report = Settle(*relaxation, target, state, 300);
    REQUIRE(report.converged);
    REQUIRE(report.arrived());
    const PointSet& points = relaxation->Current().points;
    for (const int q : points.near)
      REQUIRE(points.SurfaceAt(q) == 1);  // only the catheter is near a wall
  }
  double WallForce() const {
    double sum = 0;
    for (const WallSpring& spring : relaxation->Current().springs) {
      sum += spring.stiffness_N_mm * std::max(0.0, spring.penetration_mm);
    }
    return sum;
  }
  std::vector<Vector3d> Catheter() const {
    std::vector<Vector3d> places;
    for (int s = 1; s <= kInside; ++s) places.push_back(PointAt(stack.rod(), state, s));
    return places;
  }
};

TEST_CASE("A wire drawn through a catheter at rest changes neither its wall force nor its shape") {
  struct Mesh {
    double segment_mm;
    int points;
    double force;     // of the wall force
    double shape_mm;  // everywhere
  };
  const Mesh mesh = GENERATE(Mesh{2, 4, 0.05, 0.05}, Mesh{1, 1, 0.04, 0.1}, Mesh{1, 4, 0.02, 0.03},
                             Mesh{0.5, 4, 0.001, 0.002});
  CAPTURE(mesh.segment_mm, mesh.points);
  DrawnThrough drawn(mesh.segment_mm, mesh.points, 0.2);
  const double force_N = drawn.WallForce();
  const std::vector<Vector3d> catheter = drawn.Catheter();
  // Friction bears a substantial part: without it the catheter would press more.
  REQUIRE(DrawnThrough(mesh.segment_mm, mesh.points, 0).WallForce() > 1.025 * force_N);
  double change = 0;
  double moved_mm = 0;
  // 40 mm back and forth, with stops at any place within a segment.
  for (const double way_mm : {1.3, 3.9, 8.6, 15.7, 22.1, 31.4, 40.0, 33.3, 26.2, 14.9, 6.8, 0.0}) {
    drawn.DrawTo(way_mm);
    change = std::max(change, std::abs(drawn.WallForce() / force_N - 1));
    const std::vector<Vector3d> now = drawn.Catheter();
    for (std::size_t k = 0; k < now.size(); ++k) {
      moved_mm = std::max(moved_mm, (now[k] - catheter[k]).norm());
    }
  }
  CHECK(change < mesh.force);
  CHECK(moved_mm < mesh.shape_mm);
}

TEST_CASE("Friction of a stack whose instruments slide and turn in each other takes no heap") {
  DrawnThrough drawn(1, 4, 0.2);
  const std::size_t allocated = AllocationCount();
  for (int k = 1; k <= 60; ++k) {
    CountedBudget budget(3);
    drawn.relaxation->Tick({{DrawnThrough::kInside + DrawnThrough::kBeyond + 0.31 * k, 0.05 * k},
                            {DrawnThrough::kInside - 0.17 * k, -0.02 * k}},
                           budget, drawn.state);
  }
  CHECK(AllocationCount() == allocated);
}

}  // namespace
}  // namespace torquer::test
