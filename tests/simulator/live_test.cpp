#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <thread>
#include <torquer_lcm/health_t.hpp>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/readings_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/vital_signs_t.hpp>
#include <torquer_lcm/wire_forces_t.hpp>
#include <vector>

#include "host/bus/clock.h"
#include "host/simulator/live_loop.h"
#include "host/simulator/live_readings.h"
#include "host/simulator/live_vital_signs.h"
#include "host/simulator/replay.h"
#include "protocol/lcm_channels.h"
#include "tests/simulator/live_scene.h"
#include "tests/support/private_network.h"
#include "tests/support/scenes.h"

using torquer::test::LiveScene;
using torquer::test::SceneFile;
using torquer::test::WaitFor;

TEST_CASE("Live, commands become states with their times and doubts", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  // Also simulates a slow machine: with the smallest budget, few ticks can finish their work.
  const std::string budget =
      GENERATE(std::string(""), std::string("[relaxation]\nbudget_us = 20\n"));
  const SceneFile file(budget + torquer::test::kFriction);
  LiveScene live(file.path());
  bool has_scene = false;
  live.hands().Subscribe<torquer_lcm::scene_description_t>(
      torquer::protocol::kSceneChannel, [&](const torquer_lcm::scene_description_t& description) {
        has_scene = true;
        CHECK(description.name == "small");
        CHECK(description.effects == std::vector<std::string>{"friction"});
        CHECK(description.instruments == std::vector<std::string>{"guidewire"});
        CHECK(description.inserted_at_start_mm == std::vector<double>{120});
        CHECK(description.max_length_mm == std::vector<double>{200});
      });
  live.Start();
  for (int k = 1; k <= 20; ++k) REQUIRE(live.SendAndSee("guidewire", 0.1 * k, 0));
  REQUIRE(live.SendAndArrive("guidewire", 2, 0));
  CHECK(live.At("guidewire").insertion_mm == Approx(122));
  CHECK(live.At("guidewire").origin_us == live.command.origin_us);
  // On a slow machine, commands may be so far apart that states between them are in doubt.
  REQUIRE(live.Send("guidewire", 2, 0,
                    [&] { return (live.state().status & torquer::protocol::kWireInDoubt) == 0; }));
  live.command.flags = torquer::protocol::kCommandLift;
  REQUIRE(live.SendAndSee("guidewire", 2, 0));
  CHECK((live.state().status & torquer::protocol::kWireInDoubt) != 0);
  live.command.flags = 0;
  REQUIRE(live.SendAndSee("guidewire", std::nan(""), 0));
  CHECK((live.state().status & torquer::protocol::kWireInputRefused) != 0);
  CHECK(live.At("guidewire").insertion_mm == Approx(122));
  CHECK(WaitFor(live.hands(), [&] { return has_scene; }));
  CHECK(live.Stop().commands >= 22);
}

TEST_CASE("Live, a state without new commands is in doubt, and health names the missing sender",
          "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const SceneFile file;
  LiveScene live(file.path());
  std::vector<torquer_lcm::health_t> health;
  live.hands().Subscribe<torquer_lcm::health_t>(
      torquer::protocol::kHealthChannel,
      [&](const torquer_lcm::health_t& message) { health.push_back(message); });
  const auto in_doubt = [&] {
    return (live.state().status & torquer::protocol::kWireInDoubt) != 0;
  };
  const auto last_state_is = [&](const std::string& state) {
    return !health.empty() && health.back().state == state;
  };
  live.Start();
  REQUIRE(live.SendAndArrive("guidewire", 2, 0.1));
  // The hand dies: it sends nothing more, not even a lift.
  CHECK(WaitFor(live.hands(),
                [&] { return in_doubt() && last_state_is("no commands for guidewire"); }));
  // A later listener receives it too, and the wire stays in place.
  health.clear();
  CHECK(WaitFor(live.hands(), [&] { return last_state_is("no commands for guidewire"); }));
  CHECK(live.At("guidewire").insertion_mm == Approx(122));
  CHECK(live.At("guidewire").commanded_insertion_mm == 122);
  // Another hand takes over.
  CHECK(live.Send("guidewire", 3, 0.1, [&] { return !in_doubt() && last_state_is("running"); }));
}

TEST_CASE("Live, a second hand has no effect, and health names it", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const SceneFile file;
  LiveScene live(file.path());
  std::string said;
  std::int64_t refused = 0;
  live.hands().Subscribe<torquer_lcm::health_t>(
      torquer::protocol::kHealthChannel, [&](const torquer_lcm::health_t& message) {
        said += message.message;
        for (std::size_t k = 0; k < message.names.size(); ++k) {
          if (message.names[k] == "refused_senders") refused = message.values[k];
        }
      });
  torquer::bus::Bus stranger;
  live.Start();
  REQUIRE(live.SendAndArrive("guidewire", 2, 0));
  // Both send; the stranger's commands arrive after some of the owner's.
  torquer_lcm::instrument_command_t forged = live.command;
  forged.sequence = INT64_MAX;
  forged.insertion_mm = 30;
  REQUIRE(live.Send("guidewire", 3, 0, [&] {
    stranger.Publish(torquer::protocol::kInstrumentCommandChannel, forged);
    return refused > 0 && live.At("guidewire").commanded_insertion_mm == 123;
  }));
  CHECK_THAT(said, Catch::Contains("commands for the guidewire from port ") &&
                       Catch::Contains(" are refused, because it receives commands from port "));
}

TEST_CASE("Live, every instrument follows the box that names it, and a replay repeats it",
          "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const SceneFile file(std::string(torquer::test::kMicrocatheter) +
                       torquer::test::kGuidingCatheter);
  std::int64_t states = 0;
  {
    LiveScene live(file.path());
    live.LogTo(file.Beside("log"));
    live.Start();
    REQUIRE(live.SendAndArrive("microcatheter", 5, 0.3));
    CHECK(live.At("microcatheter").insertion_mm == Approx(65));
    CHECK(live.At("microcatheter").rotation_rad == Approx(0.3));
    CHECK(live.At("guidewire").insertion_mm == Approx(120));
    CHECK(live.At("guide").insertion_mm == Approx(30));
    REQUIRE(live.SendAndArrive("guidewire", -1, -0.2));
    CHECK(live.At("guidewire").insertion_mm == Approx(119));
    CHECK(live.At("guidewire").rotation_rad == Approx(-0.2));
    CHECK(live.At("microcatheter").commanded_insertion_mm == 65);
    CHECK(live.At("microcatheter").insertion_mm == Approx(65));
    // The other hands have not moved: a state contains the newest command of each.
    const std::int64_t sequence = live.command.sequence;
    REQUIRE(live.SendAndArrive("guide", 2.5, 0));
    CHECK(live.At("guide").insertion_mm == Approx(32.5));
    CHECK(live.At("guidewire").command_sequence == sequence);
    CHECK(live.At("microcatheter").command_sequence == sequence - 1);
    // A name unknown to the scene moves no instrument.
    live.command.instrument = "balloon";
    live.hands().Publish(torquer::protocol::kInstrumentCommandChannel, live.command);
    REQUIRE(live.SendAndArrive("guide", 2, 0.1));
    CHECK(live.At("guide").insertion_mm == Approx(32));
    CHECK(live.At("guidewire").insertion_mm == Approx(119));
    CHECK(live.At("microcatheter").insertion_mm == Approx(65));
    live.Stop();
    states = live.state().tick + 1;
  }
  torquer::scene::Scene scene(file.path());
  const auto result = torquer::simulator::Replay(scene, file.Beside("log"));
  CHECK(result.states + result.missing == states);
  CHECK(result.states > states / 2);
  CHECK(result.differing == 0);
}

TEST_CASE("Live, what observers find is published while the scene runs and when it ends",
          "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const SceneFile file("[effects.wall_force]\nthreshold_mN = 0.01\n");
  torquer::scene::Scene scene(file.path());
  torquer::simulator::ExchangeableSimulation simulation(scene);
  torquer::bus::Bus simulator_bus;
  torquer::bus::Bus listener;
  std::vector<torquer_lcm::readings_t> heard;
  listener.Subscribe<torquer_lcm::readings_t>(
      torquer::protocol::kReadingsChannel,
      [&](const torquer_lcm::readings_t& readings) { heard.push_back(readings); }, 0);
  std::atomic<bool> stop{false};
  std::thread simulator([&] { torquer::simulator::RunLive(simulation, simulator_bus, stop); });
  const bool enough = WaitFor(listener, [&] { return heard.size() >= 3; });
  stop = true;
  simulator.join();
  REQUIRE(enough);
  CHECK(WaitFor(listener, [&] { return heard.back().tick == simulation.now().tick(); }));
  for (const torquer_lcm::readings_t& readings : heard) {
    CHECK(readings.clock_id == torquer::bus::ClockId());
    REQUIRE(readings.names.size() == readings.values.size());
  }
  // The rate is never exceeded, except by the last state at the end.
  for (std::size_t k = 2; k + 1 < heard.size(); ++k) {
    CHECK(heard[k].publish_us - heard[k - 1].publish_us >= torquer::simulator::kReadingsEveryUs);
  }
  const torquer_lcm::readings_t& last = heard.back();
  CHECK(last.tick == simulation.now().tick());
  CHECK(last.time_s == simulation.now().time_s());
  const std::vector<torquer::effects::Reading> found = simulation.now().Readings();
  REQUIRE(last.names.size() == found.size());
  for (std::size_t k = 0; k < found.size(); ++k) {
    CHECK(last.names[k] == found[k].name);
    CHECK(last.values[k] == found[k].value);
  }
}

TEST_CASE("Live, health has the price of each effect", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const SceneFile file("[effects.wall_force]\nthreshold_mN = 0.01\n");
  torquer::scene::Scene scene(file.path());
  torquer::simulator::EffectPrices prices(scene.names_of_effects(), torquer::bus::MonotonicUs);
  torquer::simulator::ExchangeableSimulation simulation(scene, &prices);
  torquer::bus::Bus simulator_bus;
  torquer::bus::Bus listener;
  std::vector<std::string> names;
  listener.Subscribe<torquer_lcm::health_t>(
      torquer::protocol::kHealthChannel,
      [&](const torquer_lcm::health_t& health) {
        names.insert(names.end(), health.names.begin(), health.names.end());
      },
      0);
  std::atomic<bool> stop{false};
  std::thread simulator([&] { torquer::simulator::RunLive(simulation, simulator_bus, stop); });
  const auto named = [&](const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  CHECK(WaitFor(listener, [&] { return named("price_solver_ns"); }));
  stop = true;
  simulator.join();
  CHECK_FALSE(named("picture_us"));  // the scene has no X-ray
}

TEST_CASE("Live, every state of a scene with internal_forces has forces along the wire",
          "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const bool asked = GENERATE(true, false);
  const SceneFile file(asked ? "[effects.internal_forces]\n" : "");
  torquer::scene::Scene scene(file.path());
  torquer::simulator::ExchangeableSimulation simulation(scene);
  torquer::bus::Bus simulator_bus;
  torquer::bus::Bus listener;
  std::vector<torquer_lcm::wire_forces_t> heard;
  std::int64_t states = 0;
  listener.Subscribe<torquer_lcm::wire_forces_t>(
      torquer::protocol::kWireForcesChannel,
      [&](const torquer_lcm::wire_forces_t& forces) { heard.push_back(forces); }, 0);
  listener.Subscribe<torquer_lcm::wire_state_t>(
      torquer::protocol::kWireStateChannel, [&](const torquer_lcm::wire_state_t&) { ++states; }, 0);
  std::atomic<bool> stop{false};
  std::thread simulator([&] { torquer::simulator::RunLive(simulation, simulator_bus, stop); });
  const bool enough = WaitFor(listener, [&] { return states >= 2 && (!asked || !heard.empty()); });
  stop = true;
  simulator.join();
  REQUIRE(enough);
  REQUIRE(heard.empty() != asked);
  if (!asked) return;
  const torquer_lcm::wire_forces_t& forces = heard.back();
  CHECK(forces.names == std::vector<std::string>{"guidewire"});
  CHECK(forces.node_count == simulation.now().state().segments() + 1);
  CHECK(forces.stride == 1);
  CHECK(forces.hand_force_mN[0] == 1e3 * (*simulation.now().hands())[0].axial_N);
  CHECK(forces.tension_mN[5] == static_cast<float>(1e3 * simulation.now().forces()->tension_N[5]));
}

TEST_CASE("Live, a patient monitor publishes its curves without a gap", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const bool asked = GENERATE(true, false);
  const std::string heart =
      "[effects.heartbeat]\namplitude_mm = 1\ndirection = [0, 0, 1]\n"
      "[[effects.heartbeat.region]]\ncenter_mm = [80, 0, 0]\nradius_mm = 40\n";
  const SceneFile file(heart + (asked ? "[effects.patient_monitor]\n" : ""));
  torquer::scene::Scene scene(file.path());
  torquer::simulator::ExchangeableSimulation simulation(scene);
  torquer::bus::Bus simulator_bus;
  torquer::bus::Bus listener;
  std::vector<torquer_lcm::vital_signs_t> heard;
  listener.Subscribe<torquer_lcm::vital_signs_t>(
      torquer::protocol::kVitalSignsChannel,
      [&](const torquer_lcm::vital_signs_t& vitals) { heard.push_back(vitals); }, 0);
  int states = 0;
  listener.Subscribe<torquer_lcm::wire_state_t>(
      torquer::protocol::kWireStateChannel, [&](const torquer_lcm::wire_state_t&) { ++states; }, 0);
  std::atomic<bool> stop{false};
  std::thread simulator([&] { torquer::simulator::RunLive(simulation, simulator_bus, stop); });
  const bool enough = WaitFor(listener, [&] { return asked ? heard.size() >= 4 : states >= 100; });
  stop = true;
  simulator.join();
  REQUIRE(enough);
  REQUIRE(heard.empty() != asked);
  if (!asked) return;
  for (std::size_t k = 0; k < heard.size(); ++k) {
    const torquer_lcm::vital_signs_t& vitals = heard[k];
    CHECK(vitals.clock_id == torquer::bus::ClockId());
    CHECK(vitals.heart_rate_per_min == Approx(70));
    CHECK(std::isnan(vitals.mean_mmHg));
    const std::int64_t next = vitals.first_sample + vitals.sample_count;
    CHECK(static_cast<double>(next - 1) * vitals.sample_s <= vitals.time_s + 1e-5);
    CHECK(static_cast<double>(next) * vitals.sample_s > vitals.time_s);
    if (k == 0) continue;
    CHECK(vitals.first_sample <= heard[k - 1].first_sample + heard[k - 1].sample_count);
    CHECK(vitals.publish_us - heard[k - 1].publish_us >= torquer::simulator::kVitalSignsEveryUs);
    // Each sample is that of the message before.
    const std::int64_t shift = vitals.first_sample - heard[k - 1].first_sample;
    for (std::int64_t n = 0; n + shift < heard[k - 1].sample_count; ++n) {
      CHECK(vitals.ecg[static_cast<std::size_t>(n)] ==
            heard[k - 1].ecg[static_cast<std::size_t>(n + shift)]);
    }
  }
}

TEST_CASE("A scene without observers publishes no readings", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const SceneFile file;
  torquer::scene::Scene scene(file.path());
  torquer::simulator::ExchangeableSimulation simulation(scene);
  torquer::bus::Bus simulator_bus;
  torquer::bus::Bus listener;
  int heard = 0;
  listener.Subscribe<torquer_lcm::readings_t>(
      torquer::protocol::kReadingsChannel, [&](const torquer_lcm::readings_t&) { ++heard; }, 0);
  torquer::simulator::LiveReadings readings(simulation, simulator_bus);
  readings.PublishWhenDue(torquer::bus::MonotonicUs());
  readings.Publish();
  // A marker message: once it arrives, no earlier message is still in transit.
  torquer_lcm::readings_t marker{};
  simulator_bus.Publish(torquer::protocol::kReadingsChannel, marker);
  CHECK(WaitFor(listener, [&] { return heard > 0; }));
  CHECK(heard == 1);
}
