#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <thread>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/readings_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>

#include "host/bus/clock.h"
#include "host/simulator/live_loop.h"
#include "host/simulator/live_readings.h"
#include "protocol/lcm_channels.h"
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
      torquer::protocol::kWireStateChannel,
      [&](const torquer_lcm::wire_state_t& state) { last = state; }, 0);
  hand_bus.Subscribe<torquer_lcm::scene_description_t>(
      torquer::protocol::kSceneChannel, [&](const torquer_lcm::scene_description_t& description) {
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
  command.instrument = torquer::protocol::kGuidewire;
  command.clock_id = torquer::bus::ClockId();
  const auto send = [&](double insertion_mm, int flags) {
    ++command.sequence;
    command.insertion_mm = insertion_mm;
    command.flags = flags;
    command.origin_us = command.publish_us = torquer::bus::MonotonicUs();
    // Again and again: the simulator may not listen yet.
    for (int k = 0; k < 500 && last.command_sequence != command.sequence; ++k) {
      hand_bus.Publish(torquer::protocol::kInstrumentCommandChannel, command);
      hand_bus.Handle(10);
    }
    REQUIRE(last.command_sequence == command.sequence);
  };
  command.sequence = 0;
  for (int k = 1; k <= 20; ++k) send(0.1 * k, 0);
  CHECK(last.insertion_mm == Approx(122));
  CHECK(last.origin_us == command.origin_us);
  CHECK((last.status & torquer::protocol::kWireInDoubt) == 0);
  send(2, torquer::protocol::kCommandLift);
  CHECK((last.status & torquer::protocol::kWireInDoubt) != 0);
  send(std::nan(""), 0);
  CHECK((last.status & torquer::protocol::kWireInputRefused) != 0);
  CHECK(last.insertion_mm == Approx(122));
  for (int k = 0; k < 300 && !has_scene; ++k) hand_bus.Handle(10);
  CHECK(has_scene);
  stop = true;
  simulator.join();
  CHECK(statistics.commands >= 22);
}

TEST_CASE("Live, the catheter follows a box of its own", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const SceneFile file(torquer::test::kCatheter);
  torquer::scene::Scene scene(file.path());
  torquer::simulator::Session session(scene);
  torquer::bus::Bus simulator_bus;
  torquer::bus::Bus hand_bus;
  torquer_lcm::wire_state_t wire{};
  torquer_lcm::wire_state_t catheter{};
  hand_bus.Subscribe<torquer_lcm::wire_state_t>(
      torquer::protocol::kWireStateChannel,
      [&](const torquer_lcm::wire_state_t& state) {
        (state.instrument == torquer::protocol::kCatheter ? catheter : wire) = state;
      },
      0);
  std::atomic<bool> stop{false};
  std::thread simulator([&] { torquer::simulator::RunLive(session, simulator_bus, stop); });
  torquer_lcm::instrument_command_t command{};
  command.clock_id = torquer::bus::ClockId();
  const auto send = [&](const char* instrument, double start_mm, double insertion_mm,
                        double rotation_rad, const torquer_lcm::wire_state_t& answer) {
    command.instrument = instrument;
    command.insertion_mm = insertion_mm;
    command.rotation_rad = rotation_rad;
    const auto there = [&] {
      return answer.rotation_rad == rotation_rad && std::abs(answer.carried_mm) < 1e-9 &&
             std::abs(answer.commanded_insertion_mm - start_mm - insertion_mm) < 1e-9;
    };
    for (int k = 0; k < 6000 && !there(); ++k) {
      ++command.sequence;
      hand_bus.Publish(torquer::protocol::kInstrumentCommandChannel, command);
      hand_bus.Handle(10);
    }
    CHECK(there());
  };
  send(torquer::protocol::kCatheter, 60, 5, 0.3, catheter);
  CHECK(catheter.insertion_mm == Approx(65));
  CHECK(wire.insertion_mm == Approx(120));
  send(torquer::protocol::kGuidewire, 120, -1, -0.2, wire);
  CHECK(wire.insertion_mm == Approx(119));
  CHECK(wire.commanded_catheter_insertion_mm == 65);
  CHECK(catheter.insertion_mm == Approx(65));
  stop = true;
  simulator.join();
}

TEST_CASE("Live, what observers find is published while the scene runs and when it ends",
          "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const SceneFile file("[effects.wall_force]\nthreshold_mN = 0.01\n");
  torquer::scene::Scene scene(file.path());
  torquer::simulator::Session session(scene);
  torquer::bus::Bus simulator_bus;
  torquer::bus::Bus listener;
  std::vector<torquer_lcm::readings_t> heard;
  listener.Subscribe<torquer_lcm::readings_t>(
      torquer::protocol::kReadingsChannel,
      [&](const torquer_lcm::readings_t& readings) { heard.push_back(readings); }, 0);
  std::atomic<bool> stop{false};
  std::thread simulator([&] { torquer::simulator::RunLive(session, simulator_bus, stop); });
  for (int k = 0; k < 6000 && heard.size() < 3; ++k) listener.Handle(10);
  stop = true;
  simulator.join();
  REQUIRE(heard.size() >= 3);
  for (int k = 0; k < 6000 && listener.Handle(10) > 0;) ++k;
  for (const torquer_lcm::readings_t& readings : heard) {
    CHECK(readings.clock_id == torquer::bus::ClockId());
    REQUIRE(readings.names.size() == readings.values.size());
  }
  // No more than its rate but for the last, at the end.
  for (std::size_t k = 2; k + 1 < heard.size(); ++k) {
    CHECK(heard[k].publish_us - heard[k - 1].publish_us >= torquer::simulator::kReadingsEveryUs);
  }
  const torquer_lcm::readings_t& last = heard.back();
  CHECK(last.tick == session.tick());
  CHECK(last.time_s == session.time_s());
  const std::vector<torquer::effects::Reading> found = session.Readings();
  REQUIRE(last.names.size() == found.size());
  for (std::size_t k = 0; k < found.size(); ++k) {
    CHECK(last.names[k] == found[k].name);
    CHECK(last.values[k] == found[k].value);
  }
}

TEST_CASE("A scene without observers publishes no readings", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const SceneFile file;
  torquer::scene::Scene scene(file.path());
  torquer::simulator::Session session(scene);
  torquer::bus::Bus simulator_bus;
  torquer::bus::Bus listener;
  int heard = 0;
  listener.Subscribe<torquer_lcm::readings_t>(
      torquer::protocol::kReadingsChannel, [&](const torquer_lcm::readings_t&) { ++heard; }, 0);
  torquer::simulator::LiveReadings readings(session, simulator_bus);
  readings.PublishWhenDue(torquer::bus::MonotonicUs());
  readings.Publish();
  // A message that did go out, so that none before it is still on its way.
  torquer_lcm::readings_t marker{};
  simulator_bus.Publish(torquer::protocol::kReadingsChannel, marker);
  for (int k = 0; k < 6000 && heard == 0; ++k) listener.Handle(10);
  CHECK(heard == 1);
}
