#include "host/simulator/effect_prices.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <map>
#include <string>

#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"
#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"

using torquer::simulator::Command;
using torquer::simulator::EffectPrices;
using torquer::simulator::Simulation;

namespace {

// Clock that the test advances; each read adds 1 ns.
std::int64_t now_ns = 0;
std::int64_t Look() { return ++now_ns; }

// Energy whose every evaluation takes 1000 ns.
class SlowTerm final : public torquer::EnergyTerm,
                       public torquer::ContactTerm,
                       public torquer::TimedTerm,
                       public torquer::BetweenTerm {
 public:
  void Begin(const torquer::PointSet&) override { now_ns += 10; }
  double Add(const torquer::PointSet&, torquer::PointDerivatives&) const override {
    now_ns += 1000;
    return 4;
  }
  void End(const torquer::PointSet&) override { now_ns += 100; }
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed + 7; }
  bool Dissipates() const override { return true; }
  torquer::ContactTerm* contact_term() override { return this; }
  void MoveSurfaces(
      const torquer::PointSet&,
      const std::array<torquer::SurfaceMove, torquer::kMostInstruments>& moves) override {
    moved_mm = moves[0].along_mm;
  }
  bool ActsOnWall() const override { return true; }
  torquer::TimedTerm* timed_term() override { return this; }
  void SetMotionFraction(double given) override { fraction = given; }
  torquer::BetweenTerm* between_term() override { return this; }
  const torquer::Sliding& sliding() const override { return sliding_; }
  bool SlidesInLumen() const override { return true; }

  double moved_mm = 0;
  double fraction = 0;

 private:
  const torquer::Sliding sliding_;
};

std::map<std::string, double> Taken(EffectPrices& prices) {
  std::map<std::string, double> taken;
  for (const auto& [name, us] : prices.Take()) taken[name] = us;
  return taken;
}

}  // namespace

TEST_CASE("Prices are the time of each effect, apart from the solver's", "[simulator]") {
  EffectPrices prices({"slow", "observer", "idle"}, Look);
  SlowTerm slow;
  torquer::EnergyTerm& watched = *prices.Watch(0, &slow);
  CHECK(watched.Dissipates());
  CHECK(watched.Hash(1) == 8);
  const torquer::PointSet points;
  REQUIRE(watched.contact_term() != nullptr);
  CHECK(watched.contact_term()->ActsOnWall());
  watched.contact_term()->MoveSurfaces(points, {{{.along_mm = 3}}});
  CHECK(slow.moved_mm == 3);
  REQUIRE(watched.timed_term() != nullptr);
  watched.timed_term()->SetMotionFraction(0.25);
  CHECK(slow.fraction == 0.25);
  CHECK(watched.between_term() == slow.between_term());
  torquer::PointDerivatives derivatives;
  const auto tick = [&] {
    prices.BeginTick();
    const auto relax = [&] {
      watched.Begin(points);
      for (int k = 0; k < 3; ++k) CHECK(watched.Add(points, derivatives) == 4);
      watched.End(points);
      now_ns += 50'000;
      return 5;
    };
    if (!prices.measures()) return relax();
    prices.Measure(1, [] { now_ns += 2000; });
    return prices.MeasureSolver(relax);
  };
  CHECK(prices.Take().empty());
  // One tick in sixteen is measured, including the first.
  for (int k = 0; k < 2 * EffectPrices::kEvery; ++k) CHECK(tick() == 5);
  const auto taken = Taken(prices);
  REQUIRE(taken.size() == 3);
  CHECK(taken.at("slow") == Approx(3.11).margin(0.02));
  CHECK(taken.at("observer") == Approx(2).margin(0.02));
  CHECK(taken.at("solver") == Approx(50).margin(0.05));
  CHECK(prices.Take().empty());
  // An effect that took no part in a second is still listed for it.
  prices.BeginTick();
  prices.MeasureSolver([] { now_ns += 1000; });
  CHECK(Taken(prices).at("slow") == 0);
}

namespace {

std::string Shipped(const std::string& name) {
  std::ifstream in(torquer::test::SourcePath("/host/scenes/" + name + ".toml"));
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string WithoutTorsion(std::string text) {
  const std::string torsion = "[effects.torsion]\n";
  const std::size_t place = text.find(torsion);
  REQUIRE(place != std::string::npos);
  return text.erase(place, torsion.size());
}

// Two instruments on one curve, or with room, that twist and slide in each other.
std::string Nested(const std::string& effects) {
  return "name = \"nested\"\n[vessel]\nkind = \"ty_phantom\"\nwall_stiffness_N_mm2 = 0.5\n"
         "[entry]\ncenterline = \"main\"\nat_mm = 1\n"
         "[[instrument]]\nmax_length_mm = 200\nradius_mm = 0.2\nrigidity_N_mm2 = 0.02\n"
         "linear_density_g_m = 2\ntip_mm = 10\ntip_angle_deg = 30\ninserted_at_start_mm = 110\n"
         "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\ninner_radius_mm = 0.6\n"
         "linear_density_g_m = 2\nradius_mm = 0.8\nrigidity_N_mm2 = 0.05\ninserted_at_start_mm = "
         "90\n"
         "[effects.torsion]\n[effects.friction]\ncoefficient = 0.1\n"
         "[effects.friction_between]\ncoefficient = 0.1\n" +
         effects;
}

}  // namespace

TEST_CASE("Measuring prices does not change the simulation", "[simulator]") {
  const std::string text =
      GENERATE(Shipped("calcified"), Shipped("buddy_wire"), WithoutTorsion(Shipped("buddy_wire")),
               Nested(""), Nested("[effects.clearance]\n"), Nested("[effects.inertia]\n"));
  const torquer::test::TemporaryFolder folder;
  const std::string path = folder.Path("scene.toml");
  std::ofstream(path) << text;
  CAPTURE(text);
  torquer::scene::Scene priced_scene(path);
  torquer::scene::Scene plain_scene(path);
  EffectPrices prices(priced_scene.names_of_effects(), Look);
  Simulation priced(priced_scene, &prices);
  Simulation plain(plain_scene);
  REQUIRE(priced.state_hash() == plain.state_hash());
  for (int k = 1; k <= torquer::test::Rounds(40, 4); ++k) {
    Command command;
    command.time_s = 0.01 * k;
    command.target = priced_scene.start();
    for (auto& place : command.target) {
      place.insertion_mm += 0.3 * k;
      place.rotation_rad += 0.05 * k;
    }
    torquer::CountedBudget one(1000), other(1000);
    priced.Tick(command, one);
    plain.Tick(command, other);
    REQUIRE(priced.state_hash() == plain.state_hash());
  }
}

TEST_CASE("Prices name the effects of the scene", "[simulator]") {
  torquer::scene::Scene scene(torquer::test::SourcePath("/host/scenes/calcified.toml"));
  EffectPrices prices(scene.names_of_effects(), Look);
  Simulation priced(scene, &prices);
  CHECK(priced.prices() == &prices);
  torquer::scene::Scene plain_scene(scene.path());
  CHECK(Simulation(plain_scene).prices() == nullptr);
  for (int k = 1; k <= 80; ++k) {
    Command command;
    command.target = scene.start();
    command.target[0].insertion_mm += 0.5 * k;
    torquer::CountedBudget budget(1000);
    priced.Tick(command, budget);
  }
  const auto taken = Taken(prices);
  CHECK(taken.at("friction") > 0);
  CHECK(taken.at("wall_force") > 0);
  CHECK(taken.at("solver") > 0);
  CHECK(taken.count("compliance") == 0);  // its work is inside the solver's look-ups
}
