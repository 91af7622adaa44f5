// Outlets: a wire that reaches an end of the model is held there, and comes back with its hand.
#include "host/simulator/effects/observers/outlets.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <string>

#include "host/simulator/simulation.h"
#include "host/simulator/vessel/surface_mesh.h"
#include "protocol/lcm_channels.h"
#include "tests/support/made_meshes.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {
namespace {

using simulator::Command;
using simulator::Simulation;

// A straight tube along x of 60 mm and radius 3 mm, open at both ends.
constexpr double kTubeMm = 60;
constexpr double kWireMm = 0.4;

scene::SceneSpec OutletScene(const std::string& effects) {
  const std::string text =
      "name = \"tube\"\n[vessel]\nkind = \"straight_tube\"\nlength_mm = 60\nradius_mm = 3\n"
      "wall_stiffness_N_mm2 = 10\n[entry]\ncenterline = \"tube\"\nat_mm = 0.5\n"
      "[[instrument]]\nname = \"guidewire\"\nmax_length_mm = 200\nradius_mm = 0.4\n"
      "rigidity_N_mm2 = 1\n";
  return scene::ParseScene(text + effects, "tube.toml", ".");
}

Command OutletCommand(double insertion_mm) {
  Command command;
  command.target = InstrumentPoses(insertion_mm, 0);
  return command;
}

bool HasLeft(const Simulation& simulation) {
  return (simulation.status() & protocol::kWireLeftModel) != 0;
}

double OutletReading(const Simulation& simulation, const std::string& name) {
  for (const effects::Reading& reading : simulation.Readings()) {
    if (reading.name == name) return reading.value;
  }
  return std::nan("");
}

void PushTo(Simulation& simulation, double insertion_mm) {
  CountedBudget budget(100000);
  simulation.Tick(OutletCommand(insertion_mm), budget);
}

TEST_CASE("A wire that reaches an outlet leaves the model, without force on the wall",
          "[outlets]") {
  scene::Scene scene(OutletScene("[effects.outlets]\n"));
  Simulation simulation(scene);
  // In one row or in many: the tip stops 1 mm before the end, less its radius.
  const int rows = GENERATE(1, 100);
  for (int k = 1; k <= rows; ++k) PushTo(simulation, 100.0 * k / rows);
  const double end_mm = simulation.state().nodes().back().x();
  CHECK(end_mm > kTubeMm - 1 - kWireMm - 0.3);
  CHECK(end_mm < kTubeMm - kWireMm);
  CHECK(simulation.report().max_penetration_mm == 0);
  CHECK(HasLeft(simulation));
  CHECK(simulation.at_rest());
  const double held_mm = simulation.state().insertion_mm();
  CHECK(OutletReading(simulation, "left_model_mm") == Approx(100 - held_mm));
  CHECK(OutletReading(simulation, "left_model_events") == 1);

  // It stays while the hand comes back, and follows when it is back.
  PushTo(simulation, held_mm + 5);
  CHECK(HasLeft(simulation));
  CHECK(simulation.state().insertion_mm() == held_mm);
  PushTo(simulation, held_mm - 10);
  CHECK_FALSE(HasLeft(simulation));
  CHECK(simulation.state().insertion_mm() == Approx(held_mm - 10));
  CHECK(OutletReading(simulation, "left_model_mm") == 0);
  PushTo(simulation, 100);
  CHECK(OutletReading(simulation, "left_model_events") == 2);
}

TEST_CASE("Without the effect, the same wire presses on the end", "[outlets]") {
  scene::Scene scene(OutletScene(""));
  Simulation simulation(scene);
  for (int k = 1; k <= 20; ++k) PushTo(simulation, 5.0 * k);
  CHECK(simulation.report().max_penetration_mm > 0);
  CHECK_FALSE(HasLeft(simulation));
}

TEST_CASE("Away from outlets, the effect changes no bit of a shape", "[outlets]") {
  scene::Scene one(OutletScene("[effects.outlets]\n")), other(OutletScene(""));
  Simulation a(one), b(other);
  for (int k = 1; k <= 10; ++k) {
    PushTo(a, 3.0 * k);
    PushTo(b, 3.0 * k);
  }
  CHECK(a.state().nodes() == b.state().nodes());
}

TEST_CASE("A copy of a held wire is held, and a budget that ends within a tick is repeated",
          "[outlets]") {
  scene::Scene scene(OutletScene("[effects.outlets]\n"));
  Simulation simulation(scene);
  const int units = GENERATE(7, 30, 1000);
  const auto run = [&](int ticks) {
    simulation.Restart();
    for (int k = 0; k < ticks; ++k) {
      CountedBudget budget(units);
      simulation.Tick(OutletCommand(100), budget);
      CHECK(simulation.report().work <= units);
    }
    return simulation.state_hash();
  };
  CHECK(run(4) == run(4));
  run(40);
  const auto twin_scene = scene.MakeTwin();
  Simulation twin(*twin_scene, simulation);
  CHECK(twin.state_hash() == simulation.state_hash());
  PushTo(twin, 120);
  PushTo(simulation, 120);
  CHECK(twin.state().insertion_mm() == simulation.state().insertion_mm());
  CHECK(HasLeft(twin) == HasLeft(simulation));
}

TEST_CASE("Motion that a spent budget leaves is carried, beside an outlet as elsewhere",
          "[outlets]") {
  scene::Scene scene(OutletScene("[effects.outlets]\n"));
  Simulation simulation(scene);
  const int units = GENERATE(3, 7, 30);
  int behind = 0;
  for (int k = 0; k < 400 && !HasLeft(simulation); ++k) {
    CountedBudget budget(units);
    // The goal is inside the lumen at first, and then beyond its end.
    const double goal_mm = k < 5 ? 40 : 100;
    const TickReport& report = simulation.Tick(OutletCommand(goal_mm), budget);
    if (HasLeft(simulation)) break;
    const double reached_mm = simulation.state().insertion_mm();
    CHECK(report.carried[0].insertion_mm == Approx(goal_mm - reached_mm).margin(1e-9));
    CHECK(report.arrived() == (reached_mm == goal_mm));
    behind += reached_mm < goal_mm;
  }
  CHECK(behind > 5);
  // A held wire has no motion left.
  REQUIRE(HasLeft(simulation));
  PushTo(simulation, 100);
  CHECK(simulation.report().carried[0].insertion_mm == 0);
  CHECK(simulation.at_rest());
}

TEST_CASE("Outlets are open ends, flat ends, or free ends of centerlines", "[outlets]") {
  // A phantom without a surface: the stem's start, and the ends of three branches.
  const scene::Scene scene(scene::ParseScene(
      "name = \"ends\"\n[vessel]\nkind = \"ty_phantom\"\nwall_stiffness_N_mm2 = 1\n"
      "[entry]\ncenterline = \"main\"\nat_mm = 1\n[[instrument]]\n"
      "max_length_mm = 50\nradius_mm = 0.2\nrigidity_N_mm2 = 1\n",
      "ends.toml", "."));
  const auto outlets = vessel::FindOutlets(scene.vessel());
  REQUIRE(outlets.size() == 4);
  for (const vessel::Outlet& outlet : outlets) {
    CHECK(scene.vessel().field->Clearance(outlet.center_mm - 2 * outlet.outward) > 2);
    CHECK(scene.vessel().field->Clearance(outlet.center_mm + 9 * outlet.outward) < 0);
  }

  // Surfaces of a tube: open ends, the same inside out, and flat ends.
  const TemporaryFolder folder;
  vessel::TriangleMesh open = vessel::MakeTubeMesh(40, 3), turned = open;
  vessel::TurnInsideOut(turned);
  for (const vessel::TriangleMesh& mesh : {open, turned, vessel::MakeClosedTube(40, 3)}) {
    vessel::WriteObj(folder.Path("tube.obj"), mesh);
    vessel::Vessel tube;
    tube.surface = vessel::MeshVessel::Open(folder.Path("tube.obj"), {});
    const auto ends = vessel::FindOutlets(tube);
    REQUIRE(ends.size() == 2);
    for (const vessel::Outlet& end : ends) {
      CHECK(end.radius_mm == Approx(3).margin(0.05));
      const double x = end.outward.x() > 0 ? 40 : 0;
      CHECK((end.center_mm - Eigen::Vector3d(x, 0, 0)).norm() < 0.01);
      CHECK(std::abs(end.outward.x()) > 0.999);
    }
  }

  CHECK(outlets[0].DistanceMm(outlets[0].center_mm) == 0);
  const Eigen::Vector3d across = outlets[0].outward.unitOrthogonal();
  CHECK(outlets[0].DistanceMm(outlets[0].center_mm + 3 * outlets[0].outward + 8 * across) ==
        Approx(5));
}

}  // namespace
}  // namespace torquer::test
