#include "host/simulator/effect_prices.h"

#include <catch2/catch.hpp>
#include <map>

#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"
#include "tests/support/paths.h"

using torquer::simulator::Command;
using torquer::simulator::EffectPrices;
using torquer::simulator::Simulation;

namespace {

// Clock that the test advances; each read adds 1 ns.
std::int64_t now_ns = 0;
std::int64_t Look() { return ++now_ns; }

// Energy whose every evaluation takes 1000 ns.
class SlowTerm final : public torquer::EnergyTerm {
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
  bool ActsOnSurface() const override { return true; }
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
  CHECK(watched.ActsOnSurface());
  CHECK(watched.Hash(1) == 8);
  const torquer::PointSet points;
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

TEST_CASE("Prices change nothing that is simulated, and name the effects of the scene",
          "[simulator]") {
  torquer::scene::Scene priced_scene(torquer::test::SourcePath("/host/scenes/calcified.toml"));
  torquer::scene::Scene plain_scene(priced_scene.path());
  EffectPrices prices(priced_scene.names_of_effects(), Look);
  Simulation priced(priced_scene, &prices);
  Simulation plain(plain_scene);
  CHECK(priced.prices() == &prices);
  CHECK(plain.prices() == nullptr);
  for (int k = 1; k <= 80; ++k) {
    Command command;
    command.target = priced_scene.start();
    command.target[0].insertion_mm += 0.5 * k;
    command.target[0].rotation_rad += 0.05 * k;
    torquer::CountedBudget one(1000), other(1000);
    priced.Tick(command, one);
    plain.Tick(command, other);
    REQUIRE(priced.state_hash() == plain.state_hash());
  }
  const auto taken = Taken(prices);
  CHECK(taken.at("friction") > 0);
  CHECK(taken.at("wall_force") > 0);
  CHECK(taken.at("solver") > 0);
  CHECK(taken.count("compliance") == 0);  // its work is inside the solver's look-ups
}
