// The effect torsion in a scene, and the behavior of a twisted wire in a bent vessel.
#include <catch2/catch.hpp>
#include <fstream>
#include <numbers>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/scene/scene.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

using Catch::Contains;

// A bent tip in a bent vessel: the energy is least where both bend the same way.
struct BentWay {
  WireModel model;
  Torus field{Side::kInside, 30, 3};
  WallModel wall{.stiffness_N_mm2 = 0.5};
  std::vector<EnergyTerm*> none;
  std::unique_ptr<Relaxation> relaxation;
  WireState state;
  static constexpr double kLength = 100;

  explicit BentWay(double torsional_rigidity, double tip_curvature_1_per_mm = 0.12,
                   double tolerance = 1e-6)
      : model(MakeWire({.segment_mm = 1,
                        .rigidity_N_mm2 = 1,
                        .torsional_rigidity_N_mm2 = torsional_rigidity,
                        .tip_mm = 12,
                        .tip_curvature_1_per_mm = tip_curvature_1_per_mm,
                        .max_length_mm = 150,
                        .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}})),
        relaxation(MakeNewtonRelaxation(model, field, wall, {.tolerance = tolerance}, none)),
        state(model) {
    std::vector<Vector3d> path;
    for (double a = 0.01; a < 4; a += 0.01)
      path.emplace_back(30 * std::cos(a), 30 * std::sin(a), 0);
    state = WireState::Along(model, path, {kLength, 0});
    relaxation->Restart(state);
    REQUIRE(Settle(*relaxation, {kLength, 0}, state).converged);
  }

  TickReport TurnTo(double angle) {
    CountedBudget budget(5000);
    return relaxation->Tick({kLength, angle}, budget, state);
  }
  /// Angle in rad by which the tip lags behind the hand.
  double Lag() const {
    double sum = 0;
    for (const double twist : state.twist_rad()) sum += twist;
    return -sum;
  }
};

TEST_CASE("Turned in a bent vessel, a bent tip lags behind the hand and then whips round") {
  BentWay way(0.77);
  const double step = 0.02;
  double most = 0;
  int whips = 0;
  double before = way.Lag();
  for (int k = 1; k * step < 4 * std::numbers::pi; ++k) {
    const TickReport report = way.TurnTo(k * step);
    CHECK(report.converged);
    const double lag = way.Lag();
    most = std::max(most, lag);
    if (before - lag > 1) {  // all at once: the tip ran ahead by more than a radian
      ++whips;
      CHECK(report.snapped);
    }
    before = lag;
  }
  CHECK(most > 1);
  CHECK(whips == 2);  // once per turn
}

TEST_CASE("A wire that is stiff enough against twist follows the hand") {
  BentWay way(20);
  double before = way.Lag();
  for (int k = 1; k < 350; ++k) {
    way.TurnTo(0.02 * k);
    CHECK(std::abs(way.Lag() - before) < 0.01);
    before = way.Lag();
  }
}

TEST_CASE("The work of the hand's torque is the energy that the wire stores") {
  BentWay way(0.77);
  way.TurnTo(0.5);  // past the first whip
  REQUIRE(Settle(*way.relaxation, {BentWay::kLength, 0.5}, way.state).converged);
  const auto torque = [&way] {
    return -way.state.twist_rad()[0] * TwistStiffness(way.model, way.state, 0);
  };
  double energy = way.relaxation->Current().energy_mJ;
  double work = 0;
  double last = torque();
  for (int k = 1; k <= 100; ++k) {
    REQUIRE(way.TurnTo(0.5 + 0.03 * k).converged);
    work += 0.03 * (last + torque()) / 2;
    last = torque();
  }
  CHECK(work == Approx(way.relaxation->Current().energy_mJ - energy).epsilon(5e-3));
}

TEST_CASE(
    "A wire with rising torsional stiffness has a limit, and a wire without twist is near it") {
  // Mean distance over half a turn of the hand. The remaining difference is the holonomy torque.
  const auto travel = [](double torsional_rigidity) {
    // A torque of the residual's size is small against that of the tip, at any stiffness of the
    // wire.
    BentWay way(torsional_rigidity, 0.05, 1e-9);
    std::vector<WireState> states;
    for (int k = 1; k <= 15; ++k) {
      REQUIRE(way.TurnTo(0.2 * k).converged);
      states.push_back(way.state);
    }
    return states;
  };
  const std::vector<WireState> stiffest = travel(1000);
  const auto distance_mm = [&](double torsional_rigidity) {
    const std::vector<WireState> states = travel(torsional_rigidity);
    double sum = 0;
    int count = 0;
    for (std::size_t k = 0; k < states.size(); ++k) {
      for (std::size_t i = 0; i < states[k].nodes().size(); ++i, ++count) {
        sum += (states[k].nodes()[i] - stiffest[k].nodes()[i]).norm();
      }
    }
    return sum / count;
  };
  const double ten = distance_mm(10);
  CHECK(ten / distance_mm(100) == Approx(11).epsilon(0.2));  // (1/10 - 1/1000) / (1/100 - 1/1000)
  const double without = distance_mm(0);
  CHECK(without < 0.2);
  // A steel wire is farther from the limit: leaving twist out is then the larger error.
  CHECK(distance_mm(0.77) > 1.5 * without);
}

std::string SceneFile(const TemporaryFolder& folder, const std::string& more) {
  std::string path = folder.Path("torsion.toml");
  std::ofstream(path) << "name = \"torsion\"\n[vessel]\nkind = \"ty_phantom\"\n"
                         "wall_stiffness_N_mm2 = 0.01\n"
                         "[entry]\ncenterline = \"main\"\nat_mm = 1\n"
                         "[[instrument]]\nmax_length_mm = 100\nradius_mm = 0.178\n"
                         "rigidity_N_mm2 = 2\n"
                      << more;
  return path;
}

TEST_CASE("A scene's wire twists if the scene names torsion") {
  const TemporaryFolder folder;
  scene::Scene with(SceneFile(folder, "torsional_rigidity_ratio = 0.5\n[effects.torsion]\n"));
  CHECK(with.stack().empty_rod().twists());
  CHECK(with.stack().empty_rod().torsional_rigidity_N_mm2(7) == Approx(1));
  CHECK(with.effect_names() == std::vector<std::string>{"torsion"});
  scene::Scene without(SceneFile(folder, ""));
  CHECK_FALSE(without.stack().empty_rod().twists());
}

TEST_CASE("Impossible settings of torsion are refused") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(
      scene::Scene(SceneFile(folder, "torsional_rigidity_ratio = 0\n[effects.torsion]\n")),
      Contains("instrument[0].torsional_rigidity_ratio = 0"));
  CHECK_THROWS_WITH(scene::Scene(SceneFile(folder, "[effects.torsion]\nratio = 1\n")),
                    Contains("effects.torsion.ratio"));
  CHECK_THROWS_WITH(
      scene::Scene(SceneFile(folder, "[relaxation]\nmethod = \"paper\"\n[effects.torsion]\n")),
      Contains("effects.torsion") && Contains("newton"));
}

}  // namespace
}  // namespace torquer::test
