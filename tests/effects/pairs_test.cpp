// Every pair of effects, each with a wire that lies in the vessel from the start. State that one
// effect takes from the start must still be valid when another uses it.
#include <catch2/catch.hpp>
#include <fstream>

#include "host/simulator/simulation.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {
namespace {

constexpr char kScene[] =
    "name = \"pairs\"\n[vessel]\nkind = \"ty_phantom\"\nwall_stiffness_N_mm2 = 0.05\n"
    "[entry]\ncenterline = \"main\"\nat_mm = 1\n"
    "[[instrument]]\nmax_length_mm = 150\nradius_mm = 0.2\nrigidity_N_mm2 = 0.01\n"
    "tip_mm = 10\ntip_angle_deg = 30\ninserted_at_start_mm = 110\nlinear_density_g_m = 0.7\n";

// Two more instruments around the wire.
constexpr char kTwoMore[] =
    "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 140\nradius_mm = 0.5\n"
    "inner_radius_mm = 0.3\nrigidity_N_mm2 = 0.03\ntip_mm = 8\ntip_angle_deg = 20\n"
    "inserted_at_start_mm = 95\n"
    "[[instrument]]\nname = \"sheath\"\nmax_length_mm = 130\nradius_mm = 0.9\n"
    "inner_radius_mm = 0.7\nrigidity_N_mm2 = 0.06\ninserted_at_start_mm = 50\n";

struct Named {
  std::string name;
  std::string text;
  std::string needs = {};
  bool between = false;  // acts between instruments
};

const std::vector<Named>& All() {
  static const std::vector<Named> all = {
      {"torsion", "[effects.torsion]\n"},
      {"clearance", "[effects.clearance]\naround = [\"catheter\", \"sheath\"]\n", "", true},
      {"self_contact", "[effects.self_contact]\n"},
      {"friction", "[effects.friction]\ncoefficient = 0.2\n"},
      {"friction_between", "[effects.friction_between]\ncoefficient = 0.1\n", "", true},
      {"compliance",
       "[effects.compliance]\n[[effects.compliance.region]]\ncenterline = \"main\"\n"
       "from_mm = 60\nto_mm = 100\nradius_mm = 6\nfactor = 10\n"},
      {"gravity", "[effects.gravity]\n"},
      {"inertia", "[effects.inertia]\n"},
      {"point_load", "[effects.point_load]\nforce_mN = 0.01\nforce_direction = [0, 0, 1]\n"},
      {"heartbeat",
       "[effects.heartbeat]\namplitude_mm = 2\ndirection = [0, 0, 1]\n"
       "[[effects.heartbeat.region]]\ncenter_mm = [80, 0, 0]\nradius_mm = 40\n"},
      {"breathing",
       "[effects.breathing]\namplitude_mm = 3\ndirection = [0, 1, 0]\n"
       "[[effects.breathing.region]]\ncenter_mm = [80, 0, 0]\nradius_mm = 80\n"},
      {"wall_force", "[effects.wall_force]\nthreshold_mN = 0.5\n"},
      {"internal_forces", "[effects.internal_forces]\n"},
      {"outlets", "[effects.outlets]\n"},
      {"segment_error", "[effects.segment_error]\n"},
      {"assessment",
       "[effects.assessment]\ntarget_centerline = \"main\"\ntarget_at_mm = 200\n"
       "force_limit_mN = 1\n",
       "wall_force"},
      {"flow", "[effects.flow]\ninlet = \"main\"\ninlet_mL_s = 5\nrate_per_min = 70\n"},
      {"contrast", "[effects.contrast]\nrate_mL_s = 2\n", "flow"},
      {"fluoroscopy", "[effects.fluoroscopy]\nwidth_px = 64\nheight_px = 64\n"},
      {"lateral_plane", "[effects.lateral_plane]\n", "fluoroscopy"},
      {"patient_monitor", "[effects.patient_monitor]\nat = \"tip\"\ninstrument = \"guidewire\"\n",
       "flow"},
  };
  return all;
}

// Tables of the effects and of those that they need, each once.
std::string Text(std::vector<std::string> names, bool alone) {
  std::string text = kScene;
  if (!alone) text += kTwoMore;
  for (const Named& effect : All()) {
    for (const std::string& name : std::vector<std::string>(names)) {
      if (name == effect.name && !effect.needs.empty()) names.push_back(effect.needs);
    }
  }
  for (const Named& effect : All()) {
    if (std::find(names.begin(), names.end(), effect.name) != names.end()) text += effect.text;
  }
  return text;
}

TEST_CASE("Every effect is in a pair here") {
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    INFO(kind.name);
    CHECK(std::any_of(All().begin(), All().end(),
                      [&](const Named& effect) { return effect.name == kind.name; }));
  }
}

// Moves the instruments of a scene, twice alike.
void CheckStaysInside(const std::string& path, bool alone) {
  scene::Scene scene(path);
  simulator::Simulation simulation(scene);
  const auto run = [&] {
    simulation.Restart();
    constexpr int kTicks = Rounds(12, 4);
    for (int k = 1; k <= kTicks; ++k) {
      simulator::Command command;
      command.target = scene.start();
      command.target[0].insertion_mm += 0.3 * k;
      command.target[0].rotation_rad += 0.1 * k;
      if (!alone) {
        command.target[1].insertion_mm += 0.2 * k;
        command.target[1].rotation_rad -= 0.05 * k;
        command.target[2].rotation_rad += 0.2 * k;
      }
      command.controls.xray = k > kTicks / 2;
      command.controls.contrast = k > kTicks / 4;
      CountedBudget budget(1000);
      const TickReport& report = simulation.Tick(command, budget);
      CHECK(std::isfinite(report.energy_mJ));
      CHECK(report.energy_mJ != 0);  // a wire with a bent tip in a bend
      CHECK(report.converged);
      CHECK(report.max_penetration_mm < 0.2);
    }
    return simulation.state_hash();
  };
  const auto first = run();
  // A sanitizer finds its errors in the first run.
  if (!kUnderSanitizer) CHECK(run() == first);
}

TEST_CASE("A wire that starts inside stays inside with every pair of effects, and repeats") {
  const bool alone = GENERATE(true, false);
  const std::vector<Named>& all = All();
  const TemporaryFolder folder;
  const std::string path = folder.Path("pair.toml");
  for (std::size_t a = 0; a < all.size(); ++a) {
    for (std::size_t b = a; b < all.size(); ++b) {
      if (alone && (all[a].between || all[b].between)) continue;
      // A sanitizer takes every fourth pair alone, and another fourth with three instruments.
      if (kUnderSanitizer && (a + b) % 4 != (alone ? 0 : 1)) continue;
      INFO(all[a].name << " and " << all[b].name << (alone ? "" : ", three instruments"));
      std::ofstream(path) << Text({all[a].name, all[b].name}, alone);
      CheckStaysInside(path, alone);
    }
  }
}

TEST_CASE("All effects act at once on three instruments with room in both lumens") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("all.toml");
  std::vector<std::string> names;
  for (const Named& effect : All()) names.push_back(effect.name);
  std::ofstream(path) << Text(names, false);
  CheckStaysInside(path, false);
}

}  // namespace
}  // namespace torquer::test
