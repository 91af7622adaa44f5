// Quadratic model of the energy, compared with finite differences.
#include <catch2/catch.hpp>

#include "host/simulator/core/wire_mechanics.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/finite_differences.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

Vector3d RandomUnit(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Vector3d(normal(random), normal(random), normal(random)).normalized();
}

// One joint as a function of the steps of both its segments.
struct Joint {
  BendingLaw law;
  Vector3d u_p, n_p, u_d, n_d;
  Vector3d rest;  // at zero step

  double Energy(const Eigen::Vector4d& xi) const {
    const auto turned = [](const Vector3d& u, const Vector3d& n, double a, double b,
                           const Vector3d& what) -> Vector3d {
      const Vector3d axis = a * u.cross(n) - b * n;
      const double angle = axis.norm();
      if (angle == 0) return what;
      return Eigen::AngleAxisd(angle, axis / angle) * what;
    };
    const Vector3d r = turned(u_p, n_p, xi[0], xi[1], rest);
    const Vector3d u = turned(u_d, n_d, xi[2], xi[3], u_d);
    return 3.0 * EvaluateBending(law, (u - r).squaredNorm() / 2).g;
  }
};

TEST_CASE("The expansion of a joint is that of its energy, for any rest shape") {
  std::mt19937 random(7);
  for (const BendingLaw law : {BendingLaw::kExact, BendingLaw::kG1, BendingLaw::kG2}) {
    for (int k = 0; k < 20; ++k) {
      Joint joint{law, RandomUnit(random), {}, RandomUnit(random), {}, {}};
      joint.n_p = joint.u_p.cross(RandomUnit(random)).normalized();
      joint.n_d = joint.u_d.cross(RandomUnit(random)).normalized();
      joint.rest = k % 2 ? RandomUnit(random) : joint.u_p;
      if (joint.rest.dot(joint.u_d) < -0.8) continue;  // the continuation has its own test

      double energy = 0;
      JointTerms terms;
      ExpandJoint(law, 3.0, joint.u_p, joint.n_p, joint.rest, joint.u_d, joint.n_d, energy, terms);
      CHECK(energy == Approx(joint.Energy(Eigen::Vector4d::Zero())));

      const auto f = [&](const Eigen::VectorXd& xi) { return joint.Energy(xi); };
      const Eigen::VectorXd g = GradientOf(f, Eigen::VectorXd::Zero(4), 1e-3);
      const Eigen::MatrixXd h = HessianOf(f, Eigen::VectorXd::Zero(4), 1e-2);
      CHECK((g.head<2>() - terms.gradient_proximal).norm() < 1e-8);
      CHECK((g.tail<2>() - terms.gradient_distal).norm() < 1e-8);
      CHECK((h.topLeftCorner<2, 2>() - terms.hessian_proximal).norm() < 1e-5);
      CHECK((h.bottomRightCorner<2, 2>() - terms.hessian_distal).norm() < 1e-5);
      CHECK((h.topRightCorner<2, 2>() - terms.hessian_cross).norm() < 1e-5);
    }
  }
}

TEST_CASE("The short form for a joint that rests straight is the general one") {
  std::mt19937 random(9);
  for (int k = 0; k < 50; ++k) {
    const Vector3d u_p = RandomUnit(random);
    const Vector3d n_p = u_p.cross(RandomUnit(random)).normalized();
    const Vector3d u_d = (u_p + 0.5 * RandomUnit(random)).normalized();
    const Vector3d n_d = u_d.cross(RandomUnit(random)).normalized();
    double general_energy = 0;
    double short_energy = 0;
    JointTerms a;
    JointTerms b;
    ExpandJoint(BendingLaw::kExact, 2.0, u_p, n_p, u_p, u_d, n_d, general_energy, a);
    ExpandStraightJoint(BendingLaw::kExact, 2.0, u_p, TangentFrame(u_p, n_p), u_d,
                        TangentFrame(u_d, n_d), short_energy, b);
    CHECK(short_energy == Approx(general_energy).epsilon(1e-14));
    CHECK((a.gradient_proximal - b.gradient_proximal).norm() < 1e-14);
    CHECK((a.gradient_distal - b.gradient_distal).norm() < 1e-14);
    CHECK((a.hessian_proximal - b.hessian_proximal).norm() < 1e-13);
    CHECK((a.hessian_distal - b.hessian_distal).norm() < 1e-13);
    CHECK((a.hessian_cross - b.hessian_cross).norm() < 1e-13);
  }
}

// A bent wire with a curved, turned tip, pressed into the wall of a torus, with a constant end
// force.
struct PressedWire {
  WireParameters parameters;
  WireModel model;
  Torus field{Side::kInside, 20, 2};
  WallModel wall;
  EndForce force{Vector3d(1e-3, -2e-3, 3e-3)};
  std::vector<EnergyTerm*> terms{&force};
  WireState state;

  explicit PressedWire(BendingLaw law, double length_mm = 18.7)
      : parameters{.segment_mm = 1.3,
                   .tip_mm = 5.2,
                   .tip_curvature_1_per_mm = 0.15,
                   .law = law,
                   .sheath = {Vector3d(20, 0, 0), Vector3d(0.2, 0.9, 0.1).normalized()}},
        model(MakeWire(parameters)),
        state(model) {
    std::mt19937 random(11);
    state = Wander(model, length_mm, 0.2, random);
    state.Rotate(0.7);
    state.UpdateFrames(model);
    // Uses a frame other than the untwisted one, so that the spin matters.
    std::vector<double> spin_rad(state.normals().size());
    for (std::size_t i = 0; i < spin_rad.size(); ++i) spin_rad[i] = 0.1 * static_cast<double>(i);
    state = Spun(model, state, spin_rad);
    state.UpdateFrames(model);
    wall.stiffness_N_mm2 = 5e-3;
  }
};

TEST_CASE("Gradient and residual of the whole energy are those of finite differences") {
  const BendingLaw law = GENERATE(BendingLaw::kExact, BendingLaw::kG1, BendingLaw::kG2);
  PressedWire wire(law);
  WireMechanics mechanics(wire.model, wire.field, wire.wall, wire.terms);
  QuadraticModel at = mechanics.MakeQuadraticModel();
  QuadraticModel there = mechanics.MakeQuadraticModel();
  mechanics.BuildModel(wire.state, at);
  REQUIRE(at.max_penetration_mm > 0.1);  // wall contact is active
  const Eigen::VectorXd gradient = GradientOf(
      [&](const Eigen::VectorXd& xi) {
        mechanics.points().Forget();
        mechanics.BuildGradient(Stepped(wire.model, wire.state, Steps(xi)), there);
        return there.energy_mJ;
      },
      Eigen::VectorXd::Zero(2 * wire.state.segments()), 1e-4);
  double residual = 0;
  for (int i = 0; i < wire.state.segments(); ++i) {
    INFO("segment " << i);
    CHECK((gradient.segment<2>(2 * i) - at.gradient[i]).norm() < 1e-7 * gradient.norm());
    residual = std::max(residual, at.gradient[i].norm() / wire.parameters.rigidity_N_mm2);
  }
  CHECK(at.residual == Approx(residual));
}

TEST_CASE("An expansion of the gradient alone agrees with the full one") {
  PressedWire wire(BendingLaw::kExact);
  WireMechanics mechanics(wire.model, wire.field, wire.wall, wire.terms);
  QuadraticModel full = mechanics.MakeQuadraticModel();
  QuadraticModel gradient = mechanics.MakeQuadraticModel();
  mechanics.BuildModel(wire.state, full);
  mechanics.BuildGradient(wire.state, gradient);
  CHECK(gradient.energy_mJ == full.energy_mJ);
  CHECK(gradient.residual == full.residual);
  CHECK(gradient.max_penetration_mm == full.max_penetration_mm);
}

TEST_CASE("The energy depends on the shape alone, not on the frames that describe it") {
  PressedWire wire(BendingLaw::kExact);
  WireMechanics mechanics(wire.model, wire.field, wire.wall, wire.terms);
  QuadraticModel a = mechanics.MakeQuadraticModel();
  QuadraticModel b = mechanics.MakeQuadraticModel();
  mechanics.BuildModel(wire.state, a);
  wire.state.UntwistFrames(wire.model);
  mechanics.BuildModel(wire.state, b);
  CHECK(b.energy_mJ == Approx(a.energy_mJ).epsilon(1e-12));
  CHECK(b.residual == Approx(a.residual).epsilon(1e-12));
}

TEST_CASE("Skipped look-ups change no bit of an expansion") {
  PressedWire wire(BendingLaw::kExact);
  WireMechanics skipping(wire.model, wire.field, wire.wall, wire.terms);
  WireMechanics asking(wire.model, wire.field, wire.wall, wire.terms);
  QuadraticModel a = skipping.MakeQuadraticModel();
  QuadraticModel b = asking.MakeQuadraticModel();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> step(-0.02, 0.02);
  for (int k = 0; k < 200; ++k) {
    std::vector<Vector2d> xi;
    for (int i = 0; i < wire.state.segments(); ++i) xi.emplace_back(step(random), step(random));
    wire.state = Stepped(wire.model, wire.state, xi);
    asking.points().Forget();
    skipping.BuildModel(wire.state, a);
    asking.BuildModel(wire.state, b);
    REQUIRE(a.energy_mJ == b.energy_mJ);
    REQUIRE(a.residual == b.residual);
    REQUIRE(a.points.touches == b.points.touches);
  }
}

TEST_CASE("A joint's stiffness is EI over the length of wire that it represents") {
  const WireModel model = MakeWire({.segment_mm = 2, .rigidity_N_mm2 = 5});
  const WireState state = LayStraight(model, 12.6);
  REQUIRE(state.first_segment_mm() == Approx(2.6));
  CHECK(JointStiffness(model, state, 0) == Approx(5 / 1.3));
  CHECK(JointStiffness(model, state, 1) == Approx(5 / 2.3));
  CHECK(JointStiffness(model, state, 2) == Approx(2.5));
}

TEST_CASE("Contact points are at even distances, each with half of the pieces on either side") {
  const WireModel model = MakeWire({.segment_mm = 2});
  const FreeSpace field;
  const WallModel wall{.stiffness_N_mm2 = 1, .points_per_segment = 4};
  const std::vector<EnergyTerm*> none;
  WireMechanics mechanics(model, field, wall, none);
  PointSet points = mechanics.MakeQuadraticModel().points;
  const WireState state = LayStraight(model, 9.1);
  mechanics.points().Place(state, 0, false, points);
  REQUIRE(points.size() == 4 * state.segments());
  double sum = 0;
  for (const double w : points.weight_mm) sum += w;
  // The whole length except half a piece, which the sheath holds.
  CHECK(sum == Approx(9.1 - state.first_segment_mm() / 8));
  CHECK(points.weight_mm.back() == 0.25);
  CHECK(points.position.back()[0] == Approx(9.1));
  CHECK(points.position[0][0] == Approx(state.first_segment_mm() / 4));
  CHECK(points.FromTip(points.size() - 1) == 0);
}

}  // namespace
}  // namespace torquer::test
