// Simulations that are saved and loaded: they continue to the bit, and other bytes are refused.
#include <torquer/torquer.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <fstream>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"
#include "tests/support/scenes.h"

namespace {

using Catch::Contains;
using torquer::Command;
using torquer::Scene;
using torquer::Simulation;

// Random hand motion with X-ray, and pictures of some of the ticks.
class Session {
 public:
  explicit Session(unsigned seed) : random_(seed) {}

  void Continue(Simulation& simulation, int steps) {
    for (int k = 0; k < steps; ++k) {
      Command command = simulation.command();
      command.time_s += 0.02;
      for (torquer::Hand& hand : command.hands) {
        hand.insertion_mm = std::max(0.0, hand.insertion_mm + Uniform(-0.5, 1));
        hand.rotation_rad += Uniform(-0.2, 0.2);
      }
      command.xray = true;
      command.contrast = Uniform(0, 1) < 0.5;
      command.lao_deg = Uniform(0, 1) < 0.2 ? 10 : 0;
      command.table.height_mm = Uniform(0, 1) < 0.2 ? 20 : 0;
      using Mode = torquer::Imaging::Mode;
      command.imaging.mode = Uniform(0, 1) < 0.3 ? Mode::kCine : Mode::kAsScene;
      command.imaging.wedge_left = Drawn(0.4, -30);
      command.imaging.wedge_right = Drawn(0.3, 60);
      if (Uniform(0, 1) < 0.7) {
        // Off, arm, inject and again.
        auto& order = command.injector.order;
        order = static_cast<torquer::Injector::Order>((static_cast<int>(order) + 1) % 3);
        command.injector.volume_mL = Drawn(2, 0).share;
        command.injector.rate_mL_s = 40;
        command.injector.delay_s = command.injector.rise_s = 0.01;
      }
      const bool is_rendered = Uniform(0, 1) < 0.3;
      const int ticks = Uniform(0, 1) < 0.3 ? 2 : 1000;
      int done = 0;
      simulation.Step(command, [&](const torquer::StepReport&) {
        if (is_rendered && simulation.picture_due()) simulation.LastPicture();
        return ++done < ticks;
      });
    }
  }

 private:
  // A wedge in the beam that is sometimes turned.
  torquer::Wedge Drawn(double share, double turned_deg) {
    return {Uniform(0, 1) < 0.5 ? share : 0.1, Uniform(0, 1) < 0.5 ? turned_deg : 0};
  }
  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  std::mt19937 random_;
};

std::vector<std::uint8_t> GrayOf(Simulation& simulation) {
  return simulation.picture_planes() == 0 ? std::vector<std::uint8_t>()
                                          : simulation.LastPicture().gray;
}

Scene Shipped(const std::string& name) {
  return Scene::FromFile(torquer::test::SourcePath("/host/scenes/" + name + ".toml"));
}

void CheckGoesOn(const Scene& scene, int steps) {
  Simulation simulation(scene);
  Session session(7);
  session.Continue(simulation, steps);
  Simulation loaded = Simulation::Load(scene, simulation.Save());
  CHECK(loaded.Save() == simulation.Save());
  CHECK(loaded.picture_due() == simulation.picture_due());
  Session same = session;
  session.Continue(simulation, steps);
  same.Continue(loaded, steps);
  CHECK(loaded.state_hash() == simulation.state_hash());
  CHECK(GrayOf(loaded) == GrayOf(simulation));
  CHECK(loaded.Record() == simulation.Record());
  // From a copy, and after a restart.
  const Simulation copy = simulation;
  CHECK(Simulation::Load(scene, copy.Save()).state_hash() == simulation.state_hash());
  simulation.Restart();
  CHECK(Simulation::Load(scene, simulation.Save()).state_hash() == Simulation(scene).state_hash());
}

}  // namespace

TEST_CASE("A loaded simulation continues like the saved one, to the bit", "[api]") {
  const int steps = torquer::test::kUnderSanitizer ? 3 : 10;
  for (const char* const name : {"everything", "coronary", "triaxial"}) {
    // The road map below is of the coronaries too.
    if (torquer::test::kUnderSanitizer && std::string_view(name) == "coronary") continue;
    INFO(name);
    CheckGoesOn(Shipped(name), steps);
  }
  // The first rendered picture is the mask of the later ones.
  INFO("roadmap");
  CheckGoesOn(Shipped("coronary").With({{"effects.fluoroscopy.mode", "roadmap"}}), steps);
}

TEST_CASE("A simulation is saved within its step, and after one that threw", "[api]") {
  const torquer::test::SceneFile file(
      "linear_density_g_m = 5\n[relaxation]\nbudget_units = 3\n[effects.inertia]\n");
  const Scene scene = Scene::FromFile(file.path());
  Simulation simulation(scene);
  Command command = simulation.command();
  command.time_s = 0.02;
  command.hands[0].insertion_mm += 1;
  int ticks = 0;
  const auto check_and_throw = [&](const torquer::StepReport&) {
    const Simulation within = Simulation::Load(scene, simulation.Save());
    CHECK(within.state_hash() == simulation.state_hash());
    CHECK(within.time_s() == simulation.time_s());
    CHECK(Simulation(simulation).Save() == simulation.Save());
    if (++ticks == 5) throw std::runtime_error("stop");
    return true;
  };
  CHECK_THROWS_WITH(simulation.Step(command, check_and_throw), "stop");
  CHECK(Simulation::Load(scene, simulation.Save()).state_hash() == simulation.state_hash());
  // A load ends with the exception of its call.
  int calls = 0;
  const auto stop = [&] {
    if (++calls == 3) throw std::runtime_error("enough");
  };
  CHECK_THROWS_WITH(Simulation::Load(scene, simulation.Save(), stop), "enough");
}

TEST_CASE("Saved bytes of another scene or build, and damaged ones, are refused", "[api]") {
  const torquer::test::SceneFile file;
  const Scene scene = Scene::FromFile(file.path());
  Simulation simulation(scene);
  Session session(3);
  session.Continue(simulation, 3);
  const std::string saved = simulation.Save();
  for (std::size_t k = 0; k < saved.size(); ++k) {
    std::string damaged = saved;
    damaged[k] = static_cast<char>(damaged[k] ^ 0x20);
    CHECK_THROWS_AS(Simulation::Load(scene, damaged), torquer::Error);
    CHECK_THROWS_AS(Simulation::Load(scene, saved.substr(0, k)), torquer::Error);
  }
  CHECK_THROWS_WITH(Simulation::Load(scene, saved + "x"), Contains("damaged"));
  CHECK_THROWS_WITH(Simulation::Load(scene, "a text"), Contains("not a saved simulation"));
  CHECK_THROWS_WITH(Simulation::Load(Shipped("ty_phantom"), saved),
                    Contains("other contents of a scene") && Contains("ty_phantom"));
  CHECK(torquer::Build().size() == 40);
}

TEST_CASE("Copies with a common past step and end in several threads", "[api]") {
  const torquer::test::SceneFile file;
  const Scene scene = Scene::FromFile(file.path());
  auto simulation = std::make_unique<Simulation>(scene);
  // Enough steps for several blocks of the past.
  Command command = simulation->command();
  for (int k = 0; k < 400; ++k) {
    command.time_s += 0.01;
    simulation->Step(command);
  }
  std::vector<std::thread> threads;
  std::vector<std::string> saved(4);
  for (std::string& out : saved) {
    threads.emplace_back([&out, command, copy = std::make_unique<Simulation>(*simulation)] {
      Command next = command;
      for (int k = 0; k < 200; ++k) {
        next.time_s += 0.01;
        copy->Step(next);
      }
      out = copy->Save();
    });
  }
  simulation.reset();
  for (std::thread& thread : threads) thread.join();
  CHECK(std::count(saved.begin(), saved.end(), saved.front()) == 4);
}
