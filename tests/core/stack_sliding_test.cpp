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

// A tube: 20 mm along x, a bend of 90 degrees towards y, and on along y.
class Bend final : public study::AnalyticField {
 public:
  explicit Bend(double bend_mm) : bend_mm_(bend_mm) {}
  void EvaluateHessian(const Vector3d& p, ClearanceSample& out) const override {
    if (p[0] < 20) {
      before_.EvaluateHessian(p, out);
    } else if (p[1] > bend_mm_) {
      beyond_.EvaluateHessian(p, out);
    } else {
      bend_.EvaluateHessian(p - Vector3d(20, bend_mm_, 0), out);
    }
  }

 private:
  double bend_mm_;
  Cylinder before_{Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), 3};
  Torus bend_{Side::kInside, bend_mm_, 3};
  Cylinder beyond_{Side::kInside, Vector3d(20 + bend_mm_, bend_mm_, 0), Vector3d::UnitY(), 3};
};

// A vessel, and the instruments in it.
struct Course {
  const ClearanceField& field;
  double inside_mm;  // of the catheter
  double wire_N_mm2;
  double catheter_N_mm2;
  double wall_N_mm2;
  Vector3d pull_N;            // on the end
  bool wire_touches = false;  // beyond the catheter
};

// A catheter held by friction, with a straight wire that reaches into the open. The catheter
// contains the same wire wherever the wire's tip is.
struct DrawnThrough {
  static constexpr double kBeyond = 8;

  Course course;
  WallModel wall;
  InstrumentStack stack;
  effects::Friction friction;
  EndForce pull;
  std::vector<EnergyTerm*> terms{&friction, &pull};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  static std::vector<WireModel> Both(const Course& course, double segment_mm) {
    std::vector<WireModel> both;
    both.push_back(MakeWire({.segment_mm = segment_mm,
                             .rigidity_N_mm2 = course.wire_N_mm2,
                             .radius_mm = 0.2,
                             .max_length_mm = 140}));
    both.push_back(MakeWire({.segment_mm = segment_mm,
                             .rigidity_N_mm2 = course.catheter_N_mm2,
                             .radius_mm = 0.5,
                             .max_length_mm = 140}));
    return both;
  }
  effects::EffectContext Context() const {
    effects::EffectContext context{stack.empty_rod(), wall};
    context.instruments.resize(2);
    return context;
  }
  DrawnThrough(const Course& in, double segment_mm, int points, double mu)
      : course(in),
        wall{.stiffness_N_mm2 = in.wall_N_mm2, .points_per_segment = points},
        stack(Both(in, segment_mm)),
        friction(mu, 0.005, Context()),
        pull(in.pull_N),
        relaxation(MakeNewtonRelaxation(stack, in.field, wall, {}, terms)),
        state(stack.empty_rod(), 2) {
    relaxation->Restart(state);
    DrawTo(0);
  }
  // Moves the wire's tip to `way_mm` beyond its start.
  void DrawTo(double way_mm) {
    const double inside_mm = course.inside_mm;
    const InstrumentPoses target{{inside_mm + kBeyond + way_mm, 0}, {inside_mm, 0}};
    const TickReport report = Settle(*relaxation, target, state, 300);
    REQUIRE(report.converged);
    REQUIRE(report.arrived());
    const PointSet& points = relaxation->Current().points;
    if (course.wire_touches) return;
    for (const int q : points.near) REQUIRE(points.SurfaceAt(q) == 1);
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
    for (int s = 1; s <= course.inside_mm; ++s)
      places.push_back(PointAt(stack.empty_rod(), state, s));
    return places;
  }
};

struct Mesh {
  double segment_mm;
  int points;
  double force;     // most change of the wall force, as a part of it
  double shape_mm;  // most change of the shape, everywhere
};

// Draws the wire by 40 mm back and forth, with stops at any place within a segment. Without
// friction the catheter must press `without` times harder, so friction bears a part.
void CheckStays(const Course& course, const Mesh& mesh, double without) {
  DrawnThrough drawn(course, mesh.segment_mm, mesh.points, 0.2);
  const double force_N = drawn.WallForce();
  const std::vector<Vector3d> catheter = drawn.Catheter();
  REQUIRE(DrawnThrough(course, mesh.segment_mm, mesh.points, 0).WallForce() > without * force_N);
  double change = 0;
  double moved_mm = 0;
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

TEST_CASE("A wire drawn through a catheter at rest changes neither its wall force nor its shape") {
  const Mesh mesh = GENERATE(Mesh{2, 4, 0.05, 0.05}, Mesh{1, 1, 0.04, 0.1}, Mesh{1, 4, 0.02, 0.03},
                             Mesh{0.5, 4, 0.001, 0.002});
  CAPTURE(mesh.segment_mm, mesh.points);
  const TwoPosts posts;
  CheckStays({posts, 65.3, 0.05, 0.5, 1, Vector3d::Zero()}, mesh, 1.025);
}

TEST_CASE("A catheter pulled in a bend keeps its friction while a wire is drawn, on any segments") {
  const Mesh mesh =
      GENERATE(Mesh{1, 2, 0.005, 0.02}, Mesh{1, 4, 0.005, 0.02}, Mesh{0.5, 2, 0.001, 0.01});
  CAPTURE(mesh.segment_mm, mesh.points);
  const Bend bend(30);
  // By the capstan law, friction of 0.2 lets the force fall by up to exp(-0.2 pi/2) = 0.73.
  CheckStays({bend, 85.3, 1, 5, 5, Vector3d(0, 0.1, 0)}, mesh, 1.1);
}

TEST_CASE("A catheter whose tip presses the wall keeps its force while a wire is drawn") {
  const Mesh mesh = GENERATE(Mesh{1, 2, 0.02, 0.02}, Mesh{0.5, 2, 0.006, 0.01});
  CAPTURE(mesh.segment_mm, mesh.points);
  const Bend bend(15);
  CheckStays({bend, 58.85, 1, 20, 5, Vector3d::Zero(), true}, mesh, 1.1);
}

TEST_CASE("Friction of a stack whose instruments slide and turn in each other takes no heap") {
  const TwoPosts posts;
  const Course course{posts, 65.3, 0.05, 0.5, 1, Vector3d::Zero()};
  DrawnThrough drawn(course, 1, 4, 0.2);
  const std::size_t allocated = AllocationCount();
  for (int k = 1; k <= 60; ++k) {
    CountedBudget budget(3);
    drawn.relaxation->Tick({{course.inside_mm + DrawnThrough::kBeyond + 0.31 * k, 0.05 * k},
                            {course.inside_mm - 0.17 * k, -0.02 * k}},
                           budget, drawn.state);
  }
  CHECK(AllocationCount() == allocated);
}

}  // namespace
}  // namespace torquer::test
