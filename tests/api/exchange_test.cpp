// An instrument is exchanged for another device while the others stay where they are.
#include <torquer/torquer.h>

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"

namespace {

using Catch::Contains;
using torquer::Command;
using torquer::Scene;
using torquer::Simulation;

constexpr std::size_t kWire = 0;
constexpr std::size_t kCatheter = 1;

/// A wire in a catheter, each a device of the library. `wire_mm`, `catheter_mm`: at the start.
Scene Tray(double wire_mm, double catheter_mm, const std::string& more = "") {
  const auto instrument = [](const std::string& name, const std::string& device, double start_mm) {
    return "[[instrument]]\nname = \"" + name + "\"\ndevice = \"" + device +
           "\"\nmax_length_mm = 200\ninserted_at_start_mm = " + std::to_string(start_mm) + "\n";
  };
  return Scene::FromText(
      "name = \"tray\"\n[vessel]\nkind = \"ty_phantom\"\nwall_stiffness_N_mm2 = 0.05\n"
      "[entry]\ncenterline = \"main\"\nat_mm = 1\n"
      "[relaxation]\nsegment_mm = 2\ntolerance = 1e-8\n" +
          instrument("wire", "sion", wire_mm) +
          instrument("catheter", "microcatheter_1_8f", catheter_mm) + more,
      ".", "tray.toml");
}

const char* const kFriction = "[effects.friction]\ncoefficient = 0.2\n";

/// Moves a hand in steps of 4 mm, and turns it.
void Move(Simulation& simulation, std::size_t hand, double to_mm, double turn_rad = 0) {
  Command command = simulation.command();
  const double from_mm = command.hands[hand].insertion_mm;
  const int steps = std::max(1, static_cast<int>(std::ceil(std::abs(to_mm - from_mm) / 4)));
  for (int k = 1; k <= steps; ++k) {
    command.time_s += 0.05;
    command.hands[hand].insertion_mm = k == steps ? to_mm : from_mm + (to_mm - from_mm) * k / steps;
    command.hands[hand].rotation_rad += turn_rad / steps;
    command.xray = true;
    command.contrast = k % 2 == 0;
    simulation.Step(command);
  }
}

std::vector<double> NodesOf(const Simulation& simulation) {
  return {simulation.nodes_mm(), simulation.nodes_mm() + 3 * simulation.node_count()};
}

/// Readings as bits, because an unknown one is NaN.
std::vector<std::uint64_t> ReadingsOf(const Simulation& simulation) {
  std::vector<std::uint64_t> bits;
  for (const torquer::Reading& reading : simulation.readings()) {
    bits.push_back(std::bit_cast<std::uint64_t>(reading.value));
  }
  return bits;
}

void CheckEqual(Simulation& one, Simulation& other) {
  CHECK(one.state_hash() == other.state_hash());
  CHECK(one.time_s() == other.time_s());
  CHECK(one.energy_mJ() == other.energy_mJ());
  CHECK(NodesOf(one) == NodesOf(other));
  for (std::size_t k = 0; k < one.scene().instruments().size(); ++k) {
    CHECK(one.InstrumentNodesMm(k) == other.InstrumentNodesMm(k));
  }
  CHECK(ReadingsOf(one) == ReadingsOf(other));
  CHECK(one.picture_due() == other.picture_due());
  if (one.picture_planes() > 0) CHECK(one.LastPicture().gray == other.LastPicture().gray);
}

double LargestDistanceMm(const std::vector<torquer::Point>& a,
                         const std::vector<torquer::Point>& b) {
  REQUIRE(a.size() == b.size());
  double largest_mm = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    largest_mm =
        std::max(largest_mm, std::hypot(a[k][0] - b[k][0], a[k][1] - b[k][1], a[k][2] - b[k][2]));
  }
  return largest_mm;
}

/// Checks that a call is refused with `said`, and changes nothing.
void CheckRefused(Simulation& simulation, const std::string& instrument, const std::string& device,
                  const std::vector<std::string>& said) {
  const std::string before = simulation.Save();
  const std::uint64_t scene = simulation.scene().content_hash();
  std::string message;
  try {
    simulation.Exchange(instrument, device);
  } catch (const torquer::Error& error) {
    message = error.what();
  }
  for (const std::string& words : said) CHECK_THAT(message, Contains(words));
  CHECK(simulation.Save() == before);
  CHECK(simulation.scene().content_hash() == scene);
  // It goes on as one that was never asked.
  Simulation asked = simulation;
  Simulation never = Simulation::Load(simulation.scene_at_start(), before);
  Move(asked, 0, asked.command().hands[0].insertion_mm + 1);
  Move(never, 0, never.command().hands[0].insertion_mm + 1);
  CHECK(asked.state_hash() == never.state_hash());
}

}  // namespace

TEST_CASE("An exchange for the same device changes nothing, to the bit", "[api]") {
  const std::string between = "[effects.friction_between]\ncoefficient = 0.1\n";
  for (const std::string& more :
       {std::string(), kFriction + std::string("[effects.torsion]\n") + between,
        kFriction + std::string("[effects.clearance]\n") + between,
        std::string("[effects.inertia]\n[effects.wall_force]\nthreshold_mN = 5\n")}) {
    INFO(more);
    const Scene scene = Tray(110, 20, more);
    Simulation simulation(scene);
    Move(simulation, kWire, 116, 1);
    Move(simulation, kCatheter, 0);
    Simulation same = simulation;
    same.Exchange("catheter", "microcatheter_1_8f");
    CHECK(same.scene().content_hash() == scene.content_hash());
    CheckEqual(same, simulation);
    for (Simulation* const one : {&simulation, &same}) {
      Move(*one, kWire, 113, -1);
      Move(*one, kCatheter, 12, 0.5);
    }
    CheckEqual(same, simulation);
  }
}

TEST_CASE("Blood, contrast agent, pictures and motions go on through an exchange", "[api]") {
  const Scene everything =
      Scene::FromFile(torquer::test::SourcePath("/host/scenes/everything.toml"))
          .With({{"instrument.microcatheter.inserted_at_start_mm", 0.0}});
  Simulation simulation(everything);
  Move(simulation, kWire, torquer::test::kUnderSanitizer ? 41 : 44, 1);
  simulation.Exchange("microcatheter", "microcatheter_1_8f");
  Move(simulation, kWire, 41, 1);
  Simulation same = simulation;
  same.Exchange("microcatheter", "microcatheter_1_8f");
  CheckEqual(same, simulation);
  for (Simulation* const one : {&simulation, &same}) Move(*one, kCatheter, 2, 0.5);
  CheckEqual(same, simulation);
}

TEST_CASE("A wire rests while the catheter around it is exchanged", "[api]") {
  for (const std::string& more :
       {std::string("[effects.torsion]\n"), std::string("[effects.clearance]\n")}) {
    INFO(more);
    Simulation simulation(Tray(110, 20, kFriction + more));
    Move(simulation, kWire, 118, 2);
    Move(simulation, kCatheter, 0);
    const std::vector<double> nodes = NodesOf(simulation);
    const std::vector<torquer::Point> wire = simulation.InstrumentNodesMm(kWire);
    const double time_s = simulation.time_s();
    simulation.Exchange("catheter", "microcatheter_2_7f");
    CHECK(simulation.scene().instruments()[kCatheter].inner_radius_mm == 0.325);
    CHECK(simulation.time_s() == time_s);
    CHECK(NodesOf(simulation) == nodes);
    // Friction still holds it.
    Move(simulation, kWire, 118);
    CHECK(LargestDistanceMm(simulation.InstrumentNodesMm(kWire), wire) < 1e-4);
  }
}

TEST_CASE("A new device behaves as one that was there from the start", "[api]") {
  std::vector<std::string> effects = {"[effects.clearance]\n"};
  if (!torquer::test::kUnderSanitizer) effects.emplace_back("[effects.torsion]\n");
  for (const std::string& more : effects) {
    INFO(more);
    for (const bool of_catheter : {true, false}) {
      INFO((of_catheter ? "catheter" : "wire"));
      const Scene scene = of_catheter ? Tray(150, 0, more) : Tray(0, 110, more);
      const std::string name = of_catheter ? "catheter" : "wire";
      const std::string device = of_catheter ? "microcatheter_2_7f" : "fielder_xt_a";
      const std::size_t rests = of_catheter ? kWire : kCatheter;
      Simulation exchanged(scene);
      Simulation fresh(scene.With({{"instrument." + name + ".device", device}}));
      for (Simulation* const one : {&exchanged, &fresh}) {
        Move(*one, rests, of_catheter ? 154 : 114, 1);
        Move(*one, 1 - rests, 20, -1);
        Move(*one, 1 - rests, 0);
        if (one == &exchanged) one->Exchange(name, device);
        Move(*one, 1 - rests, of_catheter ? 120 : 150, 1);
      }
      CHECK(exchanged.scene().content_hash() == fresh.scene().content_hash());
      for (const std::size_t k : {kWire, kCatheter}) {
        CHECK(LargestDistanceMm(exchanged.InstrumentNodesMm(k), fresh.InstrumentNodesMm(k)) < 1e-4);
      }
      CHECK(exchanged.energy_mJ() == Approx(fresh.energy_mJ()).epsilon(1e-6));
      if (torquer::test::kUnderSanitizer) continue;
      // The devices differ, so the new one has an effect.
      Simulation kept(scene);
      Move(kept, rests, of_catheter ? 154 : 114, 1);
      Move(kept, 1 - rests, of_catheter ? 120 : 150, 1);
      CHECK(std::abs(kept.energy_mJ() - fresh.energy_mJ()) > 1e-3 * fresh.energy_mJ());
    }
  }
}

TEST_CASE("A lone wire is exchanged at the entry, by either method", "[api]") {
  for (const std::string& more : {std::string("[relaxation]\nmethod = \"paper\"\n"), std::string(),
                                  std::string("[effects.torsion]\n")}) {
    INFO(more);
    // The instrument has no name, and its bent tip belongs to it alone.
    const std::string text =
        "name = \"lone\"\n[vessel]\nkind = \"ty_phantom\"\nwall_stiffness_N_mm2 = 0.05\n"
        "[entry]\ncenterline = \"main\"\nat_mm = 1\n[[instrument]]\nmax_length_mm = 200\n";
    const Scene scene = Scene::FromText(
        text + "radius_mm = 0.2\nrigidity_N_mm2 = 0.01\ntip_mm = 10\ntip_angle_deg = 40\n" + more,
        ".");
    const Scene other = Scene::FromText(text + "device = \"sion\"\n" + more, ".");
    Simulation exchanged(scene);
    Simulation fresh(other);
    Move(exchanged, kWire, 30);
    Move(exchanged, kWire, 0, 1);
    exchanged.Exchange("guidewire", "sion");
    CHECK(exchanged.scene().content_hash() == other.content_hash());
    Move(fresh, kWire, 0, 1);
    for (Simulation* const one : {&exchanged, &fresh}) Move(*one, kWire, 60, 1);
    CHECK(LargestDistanceMm(exchanged.InstrumentNodesMm(kWire), fresh.InstrumentNodesMm(kWire)) <
          1e-3);
  }
}

TEST_CASE("Copies, saved simulations and restarts have their exchanges", "[api]") {
  const Scene scene = Tray(60, 10, kFriction);
  Simulation simulation(scene);
  const Simulation begun = simulation;
  Move(simulation, kCatheter, 0);
  const Simulation before = simulation;
  simulation.Exchange("catheter", "microcatheter_2_7f");
  Move(simulation, kCatheter, 8, 1);
  Move(simulation, kCatheter, 0);
  simulation.Exchange("catheter", "microcatheter_1_8f");
  simulation.Exchange("catheter", "microcatheter_2_7f");
  Move(simulation, kCatheter, 6, 1);
  CHECK(simulation.scene_at_start().content_hash() == scene.content_hash());
  Simulation copy = simulation;
  CHECK(copy.Save() == simulation.Save());
  Simulation loaded = Simulation::Load(scene, simulation.Save());
  CHECK(loaded.Save() == simulation.Save());
  CHECK(loaded.scene().content_hash() == simulation.scene().content_hash());
  Simulation assigned(Tray(50, 0));
  assigned = simulation;
  CHECK(assigned.scene_at_start().content_hash() == scene.content_hash());
  for (Simulation* const one : {&simulation, &copy, &loaded, &assigned}) Move(*one, kCatheter, 9);
  for (Simulation* const one : {&copy, &loaded, &assigned}) CheckEqual(*one, simulation);
  // The scene of the exchanged simulation is another one.
  CHECK_THROWS_WITH(Simulation::Load(simulation.scene(), simulation.Save()),
                    Contains("other contents of a scene"));
  // Back before the exchange, and to the start.
  copy = before;
  CHECK(copy.scene().content_hash() == scene.content_hash());
  CHECK(copy.Save() == before.Save());
  simulation.Restart();
  CHECK(simulation.scene().content_hash() == scene.content_hash());
  CHECK(simulation.Save() == begun.Save());
  for (Simulation* const one : {&simulation, &assigned}) {
    *one = begun;
    Move(*one, kWire, 64);
  }
  CheckEqual(simulation, assigned);
}

TEST_CASE("An exchange that is not possible names the remedy and changes nothing", "[api]") {
  Simulation simulation(Tray(60, 10, kFriction));
  CheckRefused(simulation, "catheter", "microcatheter_2_7f",
               {"catheter is inserted by 10 mm", "withdraw it to 0 mm first"});
  Move(simulation, kCatheter, 0);
  CheckRefused(simulation, "cathter", "microcatheter_2_7f",
               {"tray has no instrument cathter", "did you mean catheter?", "wire, catheter"});
  CheckRefused(simulation, "catheter", "microcatheter_27f",
               {"no such device", "did you mean \"microcatheter_2_7f\"?"});
  // The lumen of a solid wire, and a wire for a wider catheter.
  CheckRefused(simulation, "catheter", "amplatz",
               {"catheter cannot be exchanged for the device amplatz", "inner_radius_mm",
                "more than the radius of wire, 0.1778 mm", "choose another device"});
  CheckRefused(simulation, "wire", "amplatz", {"wire is inserted by 60 mm"});
  Move(simulation, kWire, 0);
  CheckRefused(simulation, "wire", "amplatz",
               {"wire cannot be exchanged for the device amplatz", "radius of wire, 0.4445 mm"});
  // Still possible.
  simulation.Exchange("wire", "sion_blue");
  Move(simulation, kWire, 10);
  // A hand that is ahead of its instrument, because a step ended early.
  Command command = simulation.command();
  command.time_s += 1;
  command.hands[kCatheter].insertion_mm = 1;
  CHECK_THROWS_WITH(simulation.Step(command,
                                    [&](const torquer::StepReport&) {
                                      simulation.Exchange("catheter", "microcatheter_2_7f");
                                      return true;
                                    }),
                    Contains("after the step"));
}

TEST_CASE("An exchange and derivatives exclude each other", "[api]") {
  Simulation simulation(Tray(60, 0));
  simulation.TrackSensitivities({"instrument.wire.radius_mm"});
  CheckRefused(simulation, "catheter", "microcatheter_2_7f", {"while derivatives are tracked"});
  simulation.TrackSensitivities({});
  simulation.Exchange("catheter", "microcatheter_2_7f");
  CHECK_THROWS_WITH(simulation.TrackSensitivities({"instrument.wire.radius_mm"}),
                    Contains("call Restart first"));
  CHECK(simulation.scene().instruments()[kCatheter].inner_radius_mm == 0.325);
  simulation.Restart();
  simulation.TrackSensitivities({"instrument.wire.radius_mm"});
  CHECK(simulation.sensitivities().size() == 1);
}

TEST_CASE("A comparison with longer segments refuses a tip that they cannot follow, as an Error") {
  const auto scene = [](const std::string& device) {
    return Scene::FromText(
        "name = \"bent\"\n[vessel]\nkind = \"ty_phantom\"\nwall_stiffness_N_mm2 = 0.05\n"
        "[entry]\ncenterline = \"main\"\nat_mm = 1\n[relaxation]\nsegment_mm = 3\n"
        "[[instrument]]\nname = \"wire\"\nmax_length_mm = 200\ndevice = \"" +
            device + "\"\n[effects.segment_error]\n",
        ".", "bent.toml");
  };
  CHECK_THROWS_AS(Simulation(scene("j_wire_035")), torquer::Error);
  Simulation simulation(scene("sion"));
  const std::uint64_t before = simulation.state_hash();
  CHECK_THROWS_AS(simulation.Exchange("wire", "j_wire_035"), torquer::Error);
  CHECK(simulation.state_hash() == before);
  CHECK_NOTHROW(simulation.Exchange("wire", "samurai"));
}
