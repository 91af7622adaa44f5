// Bending compared with closed forms: elastica, circle, buckling load.
#include <catch2/catch.hpp>
#include <numbers>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/elastica.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// A moment on the distal segment: the energy is -M times that segment's angle in the plane z = 0. A
// wire turned by more than half a turn would leave the plane; springs hold it there.
class EndMoment final : public EnergyTerm {
 public:
  /// `angle_rad` is the approximate final angle of the segment; it distinguishes full turns.
  void SetMoment(double moment_mJ, double angle_rad) {
    moment_mJ_ = moment_mJ;
    angle_rad_ = angle_rad;
  }
  void Begin(const PointSet&) override {}
  double Add(const PointSet& points, PointDerivatives& out) const override {
    const int last = points.size() - 1;
    const int before = last - 1;  // a point of the same segment
    const Vector3d d = points.position[static_cast<std::size_t>(last)] -
                       points.position[static_cast<std::size_t>(before)];
    const Vector3d pull = (moment_mJ_ / d.squaredNorm()) * Vector3d(-d[1], d[0], 0);
    out.Touch(last);
    out.Touch(before);
    out.gradient[static_cast<std::size_t>(last)] -= pull;
    out.gradient[static_cast<std::size_t>(before)] += pull;
    double springs = 0;
    for (std::size_t q = 0; q < points.position.size(); ++q) {
      const double z = points.position[q][2];
      springs += z * z / 2;
      out.Touch(static_cast<int>(q));
      out.gradient[q][2] += z;
      if (out.with_hessian) out.hessian[q](2, 2) += 1;
    }
    const double angle = std::atan2(d[1], d[0]);
    return springs -
           moment_mJ_ * (angle_rad_ + std::remainder(angle - angle_rad_, 2 * std::numbers::pi));
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

 private:
  double moment_mJ_ = 0;
  double angle_rad_ = 0;
};

struct Beam {
  WireModel model;
  FreeSpace field;
  WallModel wall;
  std::vector<EnergyTerm*> terms;
  NewtonRelaxation relaxation;
  WireState state;

  Beam(const WireParameters& parameters, double length_mm, EnergyTerm* load)
      : model(MakeWire(parameters)),
        terms(load == nullptr ? std::vector<EnergyTerm*>{} : std::vector<EnergyTerm*>{load}),
        relaxation(model, field, wall, {.tolerance = 1e-10}, terms),
        state(LayStraight(model, length_mm)) {
    relaxation.Restart(state);
  }
  TickReport Relax() {
    return Settle(relaxation, {state.insertion_mm(), state.rotation_rad()}, state);
  }
};

constexpr double kCantilever_mm = 40;
constexpr double kCantilever_N_mm2 = 2.5;

Vector3d EndOfCantilever(int n, double load, BendingLaw law) {
  EndForce force(Vector3d(0, load * kCantilever_N_mm2 / (kCantilever_mm * kCantilever_mm), 0));
  Beam beam({.segment_mm = kCantilever_mm / n, .rigidity_N_mm2 = kCantilever_N_mm2, .law = law},
            kCantilever_mm, &force);
  REQUIRE(beam.Relax().converged);
  return beam.state.nodes().back();
}

TEST_CASE("A cantilever bends like the elastica, to second order in the segment") {
  const BendingLaw law = GENERATE(BendingLaw::kExact, BendingLaw::kG1, BendingLaw::kG2);
  for (const double load : {0.5, 2.0, 10.0}) {
    const Elastica exact = SolveElastica(load);
    const Vector3d end(exact.along * kCantilever_mm, exact.across * kCantilever_mm, 0);
    double error[3];
    int k = 0;
    for (const int n : {40, 80, 160}) error[k++] = (EndOfCantilever(n, load, law) - end).norm();
    INFO("law " << static_cast<int>(law) << " load " << load << " errors " << error[0] << " "
                << error[1] << " " << error[2]);
    CHECK(error[2] < 2e-4 * kCantilever_mm);
    CHECK(error[0] / error[1] == Approx(4).epsilon(0.1));
    CHECK(error[1] / error[2] == Approx(4).epsilon(0.1));
  }
}

// Largest distance between the nodes of two wires.
double Apart(const WireState& a, const WireState& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.nodes().size(); ++i) {
    largest = std::max(largest, (a.nodes()[i] - b.nodes()[i]).norm());
  }
  return largest;
}

TEST_CASE("The reported error of a state is its distance from equilibrium") {
  const double length = GENERATE(10.0, 40.0, 250.0);
  EndForce force(Vector3d(0, 0.7 * kCantilever_N_mm2 / (length * length), 0));
  Beam exact({.segment_mm = 1, .rigidity_N_mm2 = kCantilever_N_mm2}, length, &force);
  REQUIRE(exact.Relax().converged);
  Beam beam({.segment_mm = 1, .rigidity_N_mm2 = kCantilever_N_mm2}, length, &force);
  double residual = 1;
  int compared = 0;
  while (residual > 1e-10) {
    CountedBudget budget(1);
    residual = beam.relaxation.Tick(beam.state.poses(), budget, beam.state).residual;
    const double error_mm = Apart(beam.state, exact.state);
    INFO("length " << length << ", residual " << residual << ", error " << error_mm << " mm");
    if (error_mm > 0.1 * length || error_mm < 1e-7 * length) continue;
    ++compared;
    CHECK(beam.relaxation.SolverErrorMm(beam.state) == Approx(error_mm).epsilon(0.3));
  }
  CHECK(compared >= 1);
}

TEST_CASE("A tolerance in mm holds for the position, however long the wire") {
  const double length = GENERATE(40.0, 250.0);
  const double tolerance_mm = GENERATE(1e-2, 1e-5);
  EndForce force(Vector3d(0, 0.7 * kCantilever_N_mm2 / (length * length), 0));
  Beam exact({.segment_mm = 1, .rigidity_N_mm2 = kCantilever_N_mm2}, length, &force);
  REQUIRE(exact.Relax().converged);
  Beam beam({.segment_mm = 1, .rigidity_N_mm2 = kCantilever_N_mm2}, length, &force);
  NewtonRelaxation relaxation(beam.model, beam.field, beam.wall,
                              {.tolerance = 1, .tolerance_mm = tolerance_mm}, beam.terms);
  relaxation.Restart(beam.state);
  CHECK(Settle(relaxation, beam.state.poses(), beam.state).converged);
  CHECK(Apart(beam.state, exact.state) < 1.3 * tolerance_mm);
}

TEST_CASE("The closed form of the elastica has the small-load limit of beam theory") {
  const Elastica e = SolveElastica(1e-3);
  CHECK(e.across == Approx(1e-3 / 3).epsilon(1e-4));
  CHECK(e.end_angle == Approx(1e-3 / 2).epsilon(1e-4));
}

TEST_CASE("A part of a segment at the sheath counts with its length") {
  // The same cantilever, for every possible length of the first segment.
  const double load = 2;
  const Elastica exact = SolveElastica(load);
  const Vector3d end(exact.along * kCantilever_mm, exact.across * kCantilever_mm, 0);
  EndForce force(Vector3d(0, load * kCantilever_N_mm2 / (kCantilever_mm * kCantilever_mm), 0));
  for (double first = 0.5; first < 1.5; first += 0.099) {
    const double lambda = kCantilever_mm / (39 + first);
    Beam beam({.segment_mm = lambda, .rigidity_N_mm2 = kCantilever_N_mm2}, kCantilever_mm, &force);
    REQUIRE(beam.state.first_segment_mm() == Approx(first * lambda));
    REQUIRE(beam.Relax().converged);
    INFO("first segment " << first);
    CHECK((beam.state.nodes().back() - end).norm() < 2e-4 * kCantilever_mm);
  }
}

TEST_CASE("An end moment of 2 pi EI/L bends the wire into a circle") {
  EndMoment moment;
  Beam beam({.segment_mm = 0.5, .rigidity_N_mm2 = kCantilever_N_mm2}, kCantilever_mm, &moment);
  const int steps = 16;
  for (int k = 1; k <= steps; ++k) {
    const double turned = 2 * std::numbers::pi * k / steps;
    moment.SetMoment(turned * kCantilever_N_mm2 / kCantilever_mm, turned);
    REQUIRE(beam.Relax().converged);
    if (k == steps) break;
    const double radius = kCantilever_mm / turned;
    const Vector3d end(radius * std::sin(turned), radius * (1 - std::cos(turned)), 0);
    CHECK((beam.state.nodes().back() - end).norm() < 1e-3 * kCantilever_mm);
  }
  CHECK(beam.state.nodes().back().norm() < 1e-3 * kCantilever_mm);
  // Bending energy of a circle: EI L / (2 R^2).
  const double radius = kCantilever_mm / (2 * std::numbers::pi);
  const double energy = kCantilever_N_mm2 * kCantilever_mm / (2 * radius * radius);
  double bending = 0;
  Vector3d before = beam.model.sheath().direction;
  for (int i = 0; i < beam.state.segments(); ++i) {
    const double y = (beam.state.tangents()[i] - before).squaredNorm() / 2;
    bending += JointStiffness(beam.model, beam.state, i) * EvaluateBending(BendingLaw::kExact, y).g;
    before = beam.state.tangents()[i];
  }
  CHECK(bending == Approx(energy).epsilon(0.01));
}

TEST_CASE("A wire of constant intrinsic curvature rests as a circle") {
  const double radius = 5;
  for (const double length :
       {2 * std::numbers::pi * radius, std::numbers::pi * radius, 0.6 * radius}) {
    const double lambda = length / 60.3;  // a first segment of 1.3 lambda
    Beam beam({.segment_mm = lambda, .tip_curvature_1_per_mm = 1 / radius}, length, nullptr);
    beam.Relax();
    const Vector3d center = radius * beam.model.sheath_normal();
    double worst = 0;
    for (const Vector3d& x : beam.state.nodes()) {
      worst = std::max(worst, std::abs((x - center).norm() - radius));
    }
    INFO("length " << length << " worst " << worst);
    CHECK(worst < 0.2 * lambda * lambda / radius);
    const double angle = length / radius;
    const Vector3d end = center + radius * (std::sin(angle) * Vector3d::UnitX() -
                                            std::cos(angle) * beam.model.sheath_normal());
    CHECK((beam.state.nodes().back() - end).norm() < 0.5 * lambda * lambda / radius);
    CHECK(beam.relaxation.Current().energy_mJ < 1e-12);
  }
}

TEST_CASE("Turning the proximal end turns a free intrinsic circle by the same angle") {
  Beam beam({.segment_mm = 0.5, .tip_mm = 20, .tip_curvature_1_per_mm = 0.1}, 30, nullptr);
  beam.Relax();
  const WireState before = beam.state;
  const double angle = 2.1;
  REQUIRE(Settle(beam.relaxation, {30, angle}, beam.state).converged);
  const Eigen::AngleAxisd turn(angle, Vector3d::UnitX());
  for (std::size_t i = 0; i < before.nodes().size(); ++i) {
    CHECK((beam.state.nodes()[i] - turn * before.nodes()[i]).norm() < 1e-9);
  }
}

// Largest dead force along -x at which the straight column is stable, by its Hessian.
double BucklingForce(int n) {
  EndForce force(Vector3d::Zero());
  const double lambda = kCantilever_mm / n;
  const WireModel model = MakeWire({.segment_mm = lambda, .rigidity_N_mm2 = kCantilever_N_mm2});
  const FreeSpace field;
  const WallModel wall;
  const std::vector<EnergyTerm*> terms{&force};
  WireMechanics mechanics(model, field, wall, terms);
  QuadraticModel quadratic = mechanics.MakeQuadraticModel();
  RiccatiSweep<BendStage> sweep(model.max_segments());
  const WireState state = LayStraight(model, kCantilever_mm);
  double stable = 0;
  double unstable = 20 * kCantilever_N_mm2 / (kCantilever_mm * kCantilever_mm);
  for (int k = 0; k < 60; ++k) {
    const double middle = (stable + unstable) / 2;
    force.SetForce(Vector3d(-middle, 0, 0));
    mechanics.BuildModel(state, quadratic);
    (sweep.Factor(model, state, quadratic, 0) ? stable : unstable) = middle;
  }
  return stable;
}

TEST_CASE("A clamped column buckles at Euler's load, to second order in the segment") {
  const double euler = std::numbers::pi * std::numbers::pi * kCantilever_N_mm2 /
                       (4 * kCantilever_mm * kCantilever_mm);
  const double coarse = BucklingForce(20) / euler - 1;
  const double fine = BucklingForce(40) / euler - 1;
  INFO("relative errors " << coarse << " " << fine);
  CHECK(std::abs(fine) < 1e-3);
  CHECK(coarse / fine == Approx(4).epsilon(0.1));
}

TEST_CASE("Below Euler's load a bent column straightens, above it stays bent") {
  const double euler = std::numbers::pi * std::numbers::pi * kCantilever_N_mm2 /
                       (4 * kCantilever_mm * kCantilever_mm);
  for (const double part : {0.9, 1.1}) {
    EndForce force(Vector3d(-part * euler, 1e-3 * euler, 0));
    Beam beam({.segment_mm = 1, .rigidity_N_mm2 = kCantilever_N_mm2}, kCantilever_mm, &force);
    REQUIRE(beam.Relax().converged);
    force.SetForce(Vector3d(-part * euler, 0, 0));
    REQUIRE(beam.Relax().converged);
    INFO("part of Euler's load " << part);
    if (part < 1) {
      CHECK(std::abs(beam.state.nodes().back()[1]) < 1e-6);
    } else {
      // Post-buckled elastica, end angle a: P/Pcr = (2 K(sin(a/2)) / pi)^2.
      const double a = std::acos(beam.state.tangents().back()[0]);
      const double load = std::pow(2 * std::comp_ellint_1(std::sin(a / 2)) / std::numbers::pi, 2);
      CHECK(load == Approx(part).epsilon(2e-3));
    }
  }
}

}  // namespace
}  // namespace torquer::test
