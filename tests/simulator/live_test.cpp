#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <thread>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>

#include "host/bus/channels.h"
#include "host/bus/clock.h"
#include "host/simulator/live_loop.h"
#include "tests/simulator/scenes.h"
#include "tests/support/private_network.h"

using torquer::test::SceneFile;

TEST_CASE("Live, commands become states with their times and doubts", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const SceneFile file(torquer::test::kFriction);
  torquer::scene::Scene scene(file.path());
  torquer::simulator::Session session(scene);
  torquer::bus::Bus simulator_bus;
  torquer::bus::Bus hand_bus;
  torquer_lcm::wire_state_t last{};
  bool has_scene = false;
  hand_bus.Subscribe<torquer_lcm::wire_state_t>(
      torquer::bus::kWireStateChannel,
      [&](const torquer_lcm::wire_state_t& state) { last = state; }, 0);
  hand_bus.Subscribe<torquer_lcm::scene_description_t>(
      torquer::bus::kSceneChannel, [&](const torquer_lcm::scene_description_t& description) {
        has_scene = true;
        CHECK(description.name == "small");
        CHECK(description.effects == std::vector<std::string>{"friction"});
        CHECK(description.inserted_at_start_mm == 120);
      });
  std::atomic<bool> stop{false};
  torquer::simulator::LiveStatistics statistics;
  std::thread simulator(
      [&] { statistics = torquer::simulator::RunLive(session, simulator_bus, stop); });
  torquer_lcm::instrument_command_t command{};
  command.instrument = torquer::bus::kGuidewire;
  command.clock_id = torquer::bus::ClockId();
  const auto send = [&](double insertion_mm, int flags) {
    ++command.sequence;
    command.insertion_mm = insertion_mm;
    command.flags = flags;
    command.origin_us = command.publish_us = torquer::bus::MonotonicUs();
    // Again and again: the simulator may not listen yet.
    for (int k = 0; k < 500 && last.command_sequence != command.sequence; ++k) {
      hand_bus.Publish(torquer::bus::kInstrumentCommandChannel, command);
      hand_bus.Handle(10);
    }
    REQUIRE(last.command_sequence == command.sequence);
  };
  command.sequence = 0;
  for (int k = 1; k <= 20; ++k) send(0.1 * k, 0);
  CHECK(last.insertion_mm == Approx(122));
  CHECK(last.origin_us == command.origin_us);
  CHECK((last.status & torquer::bus::kWireInDoubt) == 0);
  send(2, torquer::bus::kCommandLift);
  CHECK((last.status & torquer::bus::kWireInDoubt) != 0);
  send(std::nan(""), 0);
  CHECK((last.status & torquer::bus::kWireInputRefused) != 0);
  CHECK(last.insertion_mm == Approx(122));
  for (int k = 0; k < 300 && !has_scene; ++k) hand_bus.Handle(10);
  CHECK(has_scene);
  stop = true;
  simulator.join();
  CHECK(statistics.commands >= 22);
}
