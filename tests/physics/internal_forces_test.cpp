// Internal forces that a state reports, compared with closed forms and with its own equilibrium.
#include "host/simulator/core/internal_forces.h"

#include <catch2/catch.hpp>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "host/simulator/effects/loads/gravity.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/elastica.h"
#include "tests/support/wire_on_post.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

InternalForces ForcesOf(const WireModel& model, const WireState& state, const Relaxation& at,
                        const std::vector<EnergyTerm*>& terms) {
  InternalForces forces;
  FindInternalForces(model, state, at.Current(), terms, forces);
  return forces;
}

TEST_CASE("Along a bent cantilever tension and moment are those of the elastica") {
  // A dead force F across the clamp. With theta the angle to the clamp, T = F sin theta and M^2 /
  // 2EI = F (sin theta_end - sin theta). At the clamp, M is F times the lever.
  constexpr double kLength = 40;
  constexpr double kRigidity = 2;
  const double load = GENERATE(0.5, 3.0);
  const double segment_mm = GENERATE(2.0, 1.0, 0.5, 0.25);
  const double force_N = load * kRigidity / (kLength * kLength);
  const WireModel model =
      MakeWire({.segment_mm = segment_mm, .rigidity_N_mm2 = kRigidity, .max_length_mm = 50});
  const FreeSpace field;
  const WallModel wall;
  EndForce force(force_N * Vector3d::UnitY());
  const std::vector<EnergyTerm*> terms{&force};
  NewtonRelaxation relaxation(model, field, wall, {.tolerance = 1e-10}, terms);
  WireState state = LayStraight(model, kLength);
  relaxation.Restart(state);
  REQUIRE(Settle(relaxation, {kLength, 0}, state).converged);

  const InternalForces forces = ForcesOf(model, state, relaxation, terms);
  const Elastica elastica = SolveElastica(load);
  const double end_N = force_N * std::sin(elastica.end_angle);
  const double within = 0.06 * segment_mm * segment_mm / 4;  // of the load, and its moment
  INFO("load " << load << " segment " << segment_mm);
  const auto n = static_cast<std::size_t>(state.segments());
  CHECK(forces.bending_mJ[0] ==
        Approx(force_N * elastica.along * kLength).margin(within * force_N * kLength));
  CHECK(forces.bending_mJ[n] == 0);
  CHECK(std::abs(forces.tension_N[0]) < 1e-9);
  CHECK(forces.tension_N[n] == Approx(end_N).margin(within * force_N));
  for (std::size_t i = 0; i < n; ++i) {
    const double moment = forces.bending_mJ[i];
    CHECK(forces.tension_N[i] + moment * moment / (2 * kRigidity) ==
          Approx(end_N).margin(within * force_N));
    CHECK(forces.line_load_N_mm[i] == 0);
    CHECK(forces.twisting_mJ[i] == Approx(0).margin(1e-12));
  }
}

TEST_CASE("The tension of a hanging wire at each node is the weight below") {
  constexpr double kLength = 39.3;
  constexpr double kWeight = 1e-4;  // N/mm
  const double segment_mm = GENERATE(2.0, 0.25);
  const int points_per_segment = GENERATE(1, 2, 8);
  const WireModel model = MakeWire({.segment_mm = segment_mm});
  const FreeSpace field;
  const WallModel wall{.points_per_segment = points_per_segment};
  effects::Gravity gravity({kWeight * Vector3d::UnitX()});
  const std::vector<EnergyTerm*> terms{&gravity};
  NewtonRelaxation relaxation(model, field, wall, {}, terms);
  WireState state = LayStraight(model, kLength);
  relaxation.Restart(state);
  REQUIRE(Settle(relaxation, {kLength, 0}, state).converged);
  const InternalForces forces = ForcesOf(model, state, relaxation, terms);
  const auto n = static_cast<std::size_t>(state.segments());
  // Pieces of two different lengths meet at node 1.
  for (std::size_t i = 2; i < n; ++i) {
    CHECK(forces.tension_N[i] == Approx(kWeight * (kLength - state.nodes()[i].x())));
  }
  // The end carries half a piece, and the sheath bears half a piece.
  const double piece_N = kWeight * segment_mm / points_per_segment;
  CHECK(forces.tension_N[n] == Approx(0).margin(piece_N));
  CHECK(forces.tension_N[0] == Approx(kWeight * kLength).margin(piece_N));
}

// Withdrawn by 2 mm, the wire slides everywhere.
void DrawBack(WireOnPost& on) {
  for (const double mm : {59.5, 59.0, 58.5, 58.0}) {
    REQUIRE(Settle(on.relaxation, {mm, 0}, on.state).converged);
  }
}

TEST_CASE("The line load of a wire on a post is tension over radius, on any mesh") {
  const double rigidity = 1;
  const double force_N = 0.05;
  const double segment_mm = GENERATE(1.0, 0.5, 0.25);
  const int points_per_segment = GENERATE(1, 2, 8);
  WireOnPost on({.force_N = force_N,
                 .rigidity_N_mm2 = rigidity,
                 .segment_mm = segment_mm,
                 .points_per_segment = points_per_segment});
  DrawBack(on);
  const InternalForces forces = ForcesOf(on.model, on.state, on.relaxation, on.terms);
  const double tension_N = force_N - rigidity / (2 * WireOnPost::kRadius * WireOnPost::kRadius);
  const double load_N_mm = tension_N / WireOnPost::kRadius;
  INFO("segments of " << segment_mm << " mm with " << points_per_segment << " points");
  double sum = 0;
  int count = 0;
  for (std::size_t i = on.NodeAt(0.6); i < on.NodeAt(1.6); ++i, ++count) {
    CHECK(forces.tension_N[i] == Approx(tension_N).epsilon(0.02));
    CHECK(forces.bending_mJ[i] == Approx(rigidity / WireOnPost::kRadius).epsilon(0.04));
    sum += forces.line_load_N_mm[i];
  }
  CHECK(sum / count == Approx(load_N_mm).epsilon(0.005 + 0.03 * segment_mm * segment_mm));
}

TEST_CASE("Tension that friction takes on a post follows exp(mu angle), on any mesh") {
  const double mu = GENERATE(0.1, 0.3);
  const double segment_mm = GENERATE(1.0, 0.5, 0.25);
  WireOnPost on({.mu = mu, .segment_mm = segment_mm});
  DrawBack(on);
  const InternalForces forces = ForcesOf(on.model, on.state, on.relaxation, on.terms);
  const double ratio = forces.tension_N[on.NodeAt(0.5)] / forces.tension_N[on.NodeAt(2.0)];
  CHECK(ratio == Approx(std::exp(1.5 * mu)).epsilon(0.02));
  // Friction is mu times the normal force, opposite to the motion: the wire was withdrawn.
  const std::size_t i = on.NodeAt(1.2);
  const Vector3d tangent = (on.state.tangents()[i - 1] + on.state.tangents()[i]).normalized();
  const Vector3d normal = on.state.nodes()[i].normalized();
  CHECK(forces.contact_N[i].dot(tangent) ==
        Approx(mu * forces.contact_N[i].dot(normal)).epsilon(0.01 + 0.05 * segment_mm));
}

TEST_CASE("Clamp, contacts, friction and load of any wire are in balance") {
  const int seed = GENERATE(range(0, 12));
  std::mt19937 random(static_cast<unsigned>(seed));
  const auto draw = [&random](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  const double ring = draw(20, 40);
  // Every other wire has a bent tip and twists; friction on its surface would turn it as well.
  const bool twists = seed % 2 == 1;
  const WireModel model = MakeWire({.segment_mm = draw(0.5, 2),
                                    .rigidity_N_mm2 = draw(0.1, 3),
                                    .torsional_rigidity_N_mm2 = twists ? draw(0.1, 2) : 0,
                                    .radius_mm = 0.2,
                                    .tip_mm = twists ? 10.0 : 0,
                                    .tip_curvature_1_per_mm = twists ? draw(0.02, 0.1) : 0,
                                    .max_length_mm = 120,
                                    .sheath = {Vector3d(ring, 0, 0), Vector3d::UnitY()}});
  const Torus field(Side::kInside, ring, draw(1.5, 4));
  const WallModel wall{.stiffness_N_mm2 = draw(0.1, 2), .points_per_segment = 1 + seed % 3};
  effects::Friction friction(twists ? 0 : draw(0, 0.4), 0.005, {model, wall});
  const Vector3d load_N(draw(-0.01, 0.01), draw(-0.01, 0.01), draw(-0.01, 0.01));
  EndForce force(load_N);
  const std::vector<EnergyTerm*> terms{&friction, &force};
  const auto relaxation = MakeNewtonRelaxation(model, field, wall, {.tolerance = 1e-9}, terms);
  WireState state(model);
  relaxation->Restart(state);
  const double length_mm = draw(50, 90);
  const double turned_rad = twists ? draw(-3, 3) : 0;
  REQUIRE(Settle(*relaxation, {length_mm, turned_rad}, state, 200).converged);
  const InternalForces forces = ForcesOf(model, state, *relaxation, terms);
  Vector3d sum_N = forces.clamp_force_N + load_N;
  Vector3d sum_mJ = forces.clamp_moment_mJ + (state.tip() - state.nodes()[0]).cross(load_N);
  double size_N = load_N.norm();
  for (std::size_t i = 0; i < state.nodes().size(); ++i) {
    sum_N += forces.contact_N[i];
    sum_mJ += (state.nodes()[i] - state.nodes()[0]).cross(forces.contact_N[i]);
    size_N += forces.contact_N[i].norm();
  }
  INFO("seed " << seed << " length " << length_mm << " forces of " << size_N << " N");
  CHECK(size_N > 0.004);
  CHECK(sum_N.norm() < 1e-6 * size_N);
  CHECK(sum_mJ.norm() < 1e-5 * size_N * ring);
}

}  // namespace
}  // namespace torquer::test
