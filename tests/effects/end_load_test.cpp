#include <catch2/catch.hpp>
#include <numbers>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/loads/point_load.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/elastica.h"
#include "tests/support/finite_differences.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

using effects::EndLoad;
using effects::PointLoad;

constexpr double kBeam_mm = 40;
constexpr double kBeam_N_mm2 = 2.5;

// Keeps a wire in the plane z = 0; otherwise it would buckle out of it.
class PlaneSprings final : public EnergyTerm {
 public:
  void Begin(const PointSet&) override {}
  double Add(const PointSet& points, PointDerivatives& out) const override {
    double energy = 0;
    for (std::size_t q = 0; q < points.position.size(); ++q) {
      const double z = points.position[q][2];
      energy += z * z / 2;
      out.Touch(static_cast<int>(q));
      out.gradient[q][2] += z;
      if (out.with_hessian) out.hessian[q](2, 2) += 1;
    }
    return energy;
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }
};

struct Beam {
  WireModel model;
  FreeSpace field;
  WallModel wall;
  PointLoad load;
  PlaneSprings springs;
  std::vector<EnergyTerm*> terms{&load, &springs};
  NewtonRelaxation relaxation;
  WireState state;

  explicit Beam(const EndLoad& end, double segment_mm = 0.5, int points = 2, double ramp_s = 0)
      : model(MakeWire({.segment_mm = segment_mm, .rigidity_N_mm2 = kBeam_N_mm2})),
        wall{.points_per_segment = points},
        load(end, ramp_s),
        relaxation(model, field, wall, {.tolerance = 1e-9}, terms),
        state(LayStraight(model, kBeam_mm)) {
    relaxation.Restart(state);
  }
  TickReport Relax() { return Settle(relaxation, {kBeam_mm, 0}, state); }
};

EndLoad EverythingAtOnce() {
  EndLoad load;
  load.force_N = {1e-3, -2e-3, 3e-3};
  load.moment_mJ = 0.3;
  load.axis = Vector3d(0.2, 0.3, 0.9).normalized();
  load.hold_N_mm = 0.02;
  load.place_mm = {10, 5, 2};
  load.align_mJ = 0.2;
  load.direction = Vector3d(0.5, -0.5, 0.3).normalized();
  return load;
}

TEST_CASE("The expansion with loads on the end is that of finite differences") {
  const int points = GENERATE(1, 2, 3);
  const double length_mm = GENERATE(1.3, 8.7);  // one segment, and several
  const FreeSpace field;
  const WallModel wall{.points_per_segment = points};
  const WireModel model = MakeWire({.segment_mm = 1.3, .rigidity_N_mm2 = 0.5});
  PointLoad load(EverythingAtOnce());
  const std::vector<EnergyTerm*> terms{&load};
  WireMechanics mechanics(model, field, wall, terms);
  QuadraticModel at = mechanics.MakeQuadraticModel();
  QuadraticModel there = mechanics.MakeQuadraticModel();
  std::mt19937 random(21);
  WireState state = Wander(model, length_mm, 0.3, random);
  mechanics.BuildModel(state, at);
  load.Begin(at.points);
  mechanics.BuildModel(state, at);
  REQUIRE(at.derivatives.on_tangents.size() == 1);
  const int n = state.segments();
  const auto energy = [&](const Eigen::VectorXd& xi) {
    mechanics.BuildGradient(Stepped(model, state, Steps(xi)), there);
    return there.energy_mJ;
  };
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(2 * n);
  const Eigen::VectorXd gradient = GradientOf(energy, zero, 1e-3);
  for (int i = 0; i < n; ++i) {
    INFO("segment " << i);
    CHECK((gradient.segment<2>(2 * i) - at.gradient[i]).norm() < 1e-7 * (1 + gradient.norm()));
  }
  // The sweep's Newton step equals that of the dense finite-difference Hessian.
  RiccatiSweep<BendStage> sweep(model.max_segments());
  const double weight = 3;
  REQUIRE(sweep.Factor(model, state, at, weight));
  std::vector<RiccatiSweep<BendStage>::Control> step;
  std::vector<double> spin;
  std::vector<Vector3d> displacement;
  sweep.Step(model, state, at, step, spin, displacement);
  Eigen::MatrixXd hessian = HessianOf(energy, zero, 1e-3);
  hessian.diagonal().array() += weight * 0.5;
  const Eigen::VectorXd expected = -hessian.ldlt().solve(gradient);
  for (int i = 0; i < n; ++i) {
    INFO("segment " << i);
    CHECK((expected.segment<2>(2 * i) - step[i]).norm() < 1e-5 * expected.norm());
  }
}

TEST_CASE("Near the moment's axis the moment fades evenly") {
  EndLoad end;
  end.moment_mJ = 0.7;
  end.axis = Vector3d(1, 0, 0);
  const FreeSpace field;
  const WallModel wall;
  const WireModel model = MakeWire({.segment_mm = 1});
  PointLoad load(end);
  const std::vector<EnergyTerm*> terms{&load};
  WireMechanics mechanics(model, field, wall, terms);
  QuadraticModel at = mechanics.MakeQuadraticModel();
  for (const double tilt : {0.02, 0.05, 0.09, 0.2}) {
    WireState state = LayStraight(model, 1);
    state = Stepped(model, state, {Vector2d(tilt, 0.3 * tilt)});
    mechanics.BuildModel(state, at);
    load.Begin(at.points);
    mechanics.BuildModel(state, at);
    const Vector2d gradient = at.gradient[0];
    const auto energy = [&](const Eigen::VectorXd& xi) {
      QuadraticModel there = mechanics.MakeQuadraticModel();
      mechanics.BuildGradient(Stepped(model, state, Steps(xi)), there);
      return there.energy_mJ;
    };
    CHECK((GradientOf(energy, Eigen::VectorXd::Zero(2), 1e-4) - gradient).norm() <
          1e-6 * (1 + gradient.norm()));
  }
}

TEST_CASE("Under an end force the wire is the elastica") {
  for (const double load : {0.5, 2.0, 10.0}) {
    EndLoad end;
    end.force_N = Vector3d(0, load * kBeam_N_mm2 / (kBeam_mm * kBeam_mm), 0);
    Beam beam(end);
    REQUIRE(beam.Relax().converged);
    const Elastica exact = SolveElastica(load);
    const Vector3d expected(exact.along * kBeam_mm, exact.across * kBeam_mm, 0);
    CHECK((beam.state.nodes().back() - expected).norm() < 2e-4 * kBeam_mm);
  }
}

TEST_CASE("Under an end moment the wire is an arc of radius EI/M, up to a whole circle") {
  const int points = GENERATE(1, 2);
  EndLoad end;
  Beam beam(end, 0.5, points);
  for (int k = 1; k <= 8; ++k) {
    const double turned = 2 * std::numbers::pi * k / 8;
    end.moment_mJ = turned * kBeam_N_mm2 / kBeam_mm;
    beam.load.SetLoad(end);
    REQUIRE(beam.Relax().converged);
    const double radius = kBeam_mm / turned;
    const Vector3d expected(radius * std::sin(turned), radius * (1 - std::cos(turned)), 0);
    INFO("turned " << turned << " end " << beam.state.nodes().back().transpose());
    CHECK((beam.state.nodes().back() - expected).norm() < 2e-3 * kBeam_mm);
  }
}

TEST_CASE("A clamp holds the end like a spring, and a stiff one holds it fast") {
  // A cantilever's end has the stiffness 3 EI/L^3 and shares the displacement with the spring.
  const double own = 3 * kBeam_N_mm2 / std::pow(kBeam_mm, 3);
  for (const double ratio : {0.5, 3.0}) {
    EndLoad end;
    end.hold_N_mm = ratio * own;
    end.place_mm = Vector3d(kBeam_mm, 0.1, 0);
    Beam beam(end);
    REQUIRE(beam.Relax().converged);
    CHECK(beam.state.nodes().back()[1] == Approx(0.1 * ratio / (1 + ratio)).epsilon(2e-3));
  }
  // Clamped at both ends, S-shaped: a guided beam with the force 12 EI d/L^3.
  EndLoad end;
  end.hold_N_mm = 1e3;
  end.place_mm = Vector3d(kBeam_mm, 0.5, 0);
  end.align_mJ = 1e3;
  end.direction = Vector3d::UnitX();
  Beam beam(end);
  REQUIRE(beam.Relax().converged);
  const Vector3d& x = beam.state.nodes().back();
  CHECK((x - end.place_mm).norm() < 0.02);
  CHECK(beam.state.tangents().back()[1] == Approx(0).margin(1e-4));
  const double middle = beam.state.nodes()[static_cast<std::size_t>(beam.state.segments() / 2)][1];
  CHECK(middle == Approx(0.25).epsilon(0.05));
}

TEST_CASE("Loads with a ramp grow in proportion to time, and begin again with the session") {
  // Cantilever with the stiffness 3 EI/L^3, a spring and a force, both at the same part of their
  // values.
  const double own = 3 * kBeam_N_mm2 / std::pow(kBeam_mm, 3);
  const double ratio = 3;
  EndLoad end;
  end.hold_N_mm = ratio * own;
  end.place_mm = Vector3d(kBeam_mm, 0.1, 0);
  end.force_N = Vector3d(0, 0.2 * own, 0);
  Beam beam(end, 0.5, 2, 2.0);
  REQUIRE(beam.load.timed() != nullptr);
  const auto expected_mm = [&](double part) {
    return part * (0.1 * ratio + 0.2) / (1 + part * ratio);
  };
  double time_s = 0;
  for (const double at_s : {0.0, 0.5, 1.0, 2.0, 3.0}) {
    const double part = std::min(at_s / 2, 1.0);
    CAPTURE(at_s);
    beam.load.AdvanceTime(at_s - time_s);
    time_s = at_s;
    REQUIRE(beam.Relax().converged);
    CHECK(beam.state.nodes().back()[1] == Approx(expected_mm(part)).epsilon(3e-3).margin(1e-9));
  }
  beam.load.Restart();
  REQUIRE(beam.Relax().converged);
  CHECK(beam.state.nodes().back()[1] == Approx(0).margin(1e-6));
}

TEST_CASE("A ramp takes the moments in proportion too") {
  const double part = 0.5;
  const double own = kBeam_N_mm2 / kBeam_mm;  // end moment of a cantilever over its end's angle
  SECTION("The moment is a half of its value after a half of the time") {
    const double turned = 1.2;
    EndLoad end;
    end.moment_mJ = turned * own;
    Beam beam(end, 0.5, 2, 2.0);
    beam.load.AdvanceTime(2 * part);
    REQUIRE(beam.Relax().converged);
    CHECK(std::asin(beam.state.tangents().back()[1]) == Approx(part * turned).epsilon(0.01));
  }
  SECTION("The clamp of a direction has a half of its stiffness then") {
    // The end's stiffness and the clamp's share the angle.
    const double angle = 0.05, ratio = 3;
    EndLoad end;
    end.align_mJ = ratio * own;
    end.direction = Vector3d(std::cos(angle), std::sin(angle), 0);
    Beam beam(end, 0.5, 2, 2.0);
    beam.load.AdvanceTime(2 * part);
    REQUIRE(beam.Relax().converged);
    CHECK(beam.state.tangents().back()[1] ==
          Approx(angle * part * ratio / (1 + part * ratio)).epsilon(0.02));
  }
}

TEST_CASE("A copy of a load on its ramp goes on from there") {
  const WireModel model = MakeWire({.segment_mm = 1});
  const FreeSpace field;
  const WallModel wall;
  const WireState state = LayStraight(model, 5);
  const auto energy_mJ = [&](PointLoad& load) {
    const std::vector<EnergyTerm*> terms{&load};
    WireMechanics mechanics(model, field, wall, terms);
    QuadraticModel at = mechanics.MakeQuadraticModel();
    mechanics.BuildModel(state, at);
    load.Begin(at.points);
    mechanics.BuildModel(state, at);
    return at.energy_mJ;
  };
  EndLoad end;
  end.force_N = {1e-3, 0, 0};  // along the wire, so its work is the force times the length
  PointLoad load(end, 2);
  load.AdvanceTime(0.5);
  PointLoad copy(end, 2);
  CHECK(copy.Hash(1) != load.Hash(1));
  copy.CopyFrom(load);
  CHECK(copy.Hash(1) == load.Hash(1));
  copy.AdvanceTime(0.5);
  CHECK(copy.Hash(1) != load.Hash(1));
  CHECK(energy_mJ(load) == Approx(-0.25e-3 * 5));
  CHECK(energy_mJ(copy) == Approx(-0.5e-3 * 5));
}

}  // namespace
}  // namespace torquer::test
