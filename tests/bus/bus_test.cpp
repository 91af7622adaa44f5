#include "host/bus/bus.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <random>
#include <stdexcept>
#include <thread>

#include "host/bus/clock.h"
#include "host/bus/health_reporter.h"
#include "host/support/error.h"
#include "protocol/lcm_channels.h"
#include "tests/bus/datagrams.h"
#include "tests/support/private_network.h"
#include "tests/support/sample_messages.h"
#include "tests/support/sanitizer.h"
#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/devices_t.hpp"
#include "torquer_lcm/exchange_command_t.hpp"
#include "torquer_lcm/hand_motion_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/imaging_command_t.hpp"
#include "torquer_lcm/injector_command_t.hpp"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/picture_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/scene_description_t.hpp"
#include "torquer_lcm/table_command_t.hpp"
#include "torquer_lcm/vital_signs_t.hpp"
#include "torquer_lcm/wedge_command_t.hpp"
#include "torquer_lcm/wire_forces_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace {

using torquer::UserError;
using torquer::bus::Bus;
using torquer_lcm::health_t;
using torquer_lcm::instrument_command_t;

std::string RefusalOf(const std::string& url) {
  try {
    const Bus bus(url);
  } catch (const UserError& error) {
    return error.what();
  }
  return "accepted";
}

instrument_command_t Command(std::int64_t sequence) {
  instrument_command_t command{};
  command.instrument = torquer::protocol::kGuidewire;
  command.sequence = sequence;
  return command;
}

// Handles messages until `done` or a generous timeout.
template <class Done>
bool HandleUntil(Bus& bus, Done done) {
  const std::int64_t end_us = torquer::bus::MonotonicUs() + 60'000'000;
  while (!done() && torquer::bus::MonotonicUs() < end_us) bus.Handle(50);
  return done();
}

}  // namespace

TEST_CASE("A bad URL is refused with its value and a remedy") {
  torquer::test::NeedPrivateNetwork();
  const auto [url, problem] = GENERATE(table<std::string, std::string>({
      {"hello", "no scheme"},
      {"carrier-pigeon://x", "unknown scheme 'carrier-pigeon'"},
      {"udpm://10.0.0.1:7667", "'10.0.0.1' is not an IPv4 multicast address"},
      {"udpm://239.255.76:7667", "'239.255.76' is not an IPv4 multicast address"},
      {"udpm://", "'' is not an IPv4 multicast address"},
      {"udpm://239.255.76.67", "no port"},
      {"udpm://239.255.76.67:70000", "no port"},
      {"udpm://239.255.76.67:7667?ttl=300", "ttl '300'"},
      {"udpm://239.255.76.67:7667?ttl=", "ttl ''"},
      {"udpm://239.255.76.67:7667?tttl=0", "unknown option 'tttl=0'"},
      {"udpm://239.255.76.67:7667?recv_buf_size=big", "recv_buf_size 'big'"},
      {"file:///no/such/folder/log?mode=r", "LCM cannot open it"},
  }));
  const std::string refusal = RefusalOf(url);
  CAPTURE(refusal);
  CHECK(refusal.find("'" + url + "'") != std::string::npos);
  CHECK(refusal.find(problem) != std::string::npos);
  CHECK(refusal.find("udpm://239.255.76.67:7667?ttl=0") != std::string::npos);
}

TEST_CASE("The environment names the default URL") {
  setenv("LCM_DEFAULT_URL", "udpm://239.1.2.3:4567?ttl=0", 1);
  CHECK(torquer::bus::DefaultUrl() == "udpm://239.1.2.3:4567?ttl=0");
  setenv("LCM_DEFAULT_URL", "", 1);
  CHECK(torquer::bus::DefaultUrl() == "udpm://239.255.76.67:7667?ttl=0");
  unsetenv("LCM_DEFAULT_URL");
  CHECK(torquer::bus::DefaultUrl() == "udpm://239.255.76.67:7667?ttl=0");
}

TEST_CASE("Published messages arrive complete and in order") {
  torquer::test::NeedPrivateNetwork();
  Bus sender;
  Bus receiver;
  std::vector<std::int64_t> seen;
  receiver.Subscribe<instrument_command_t>(
      torquer::protocol::kInstrumentCommandChannel,
      [&](const instrument_command_t& command) {
        CHECK(command.instrument == "guidewire");
        seen.push_back(command.sequence);
      },
      0);
  for (std::int64_t i = 0; i < 100; ++i) {
    REQUIRE(sender.Publish(torquer::protocol::kInstrumentCommandChannel, Command(i)));
  }
  REQUIRE(HandleUntil(receiver, [&] { return seen.size() >= 100; }));
  for (std::int64_t i = 0; i < 100; ++i) REQUIRE(seen[static_cast<std::size_t>(i)] == i);
  CHECK(receiver.counters().at(0).received == 100);
  CHECK(receiver.undecodable() == 0);
}

TEST_CASE("Undecodable messages are counted and dropped") {
  torquer::test::NeedPrivateNetwork();
  Bus bus;
  int handled = 0;
  bus.Subscribe<instrument_command_t>("A", [&](const instrument_command_t&) { ++handled; });
  bus.Subscribe<health_t>("B", [&](const health_t&) { ++handled; });

  bus.Publish("A", health_t{});  // another type

  const instrument_command_t command = Command(1);
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(command.getEncodedSize()) + 1);
  command.encode(bytes.data(), 0, static_cast<int>(bytes.size()) - 1);
  lcm_t* raw = lcm_create(bus.url().c_str());
  REQUIRE(raw != nullptr);
  const auto size = static_cast<unsigned>(bytes.size());
  lcm_publish(raw, "A", bytes.data(), size);      // a byte left over
  lcm_publish(raw, "A", bytes.data(), size - 9);  // cut short
  lcm_publish(raw, "A", bytes.data(), 0);         // empty
  lcm_destroy(raw);

  bus.Publish("A", command);
  bus.Publish("B", health_t{});
  REQUIRE(HandleUntil(bus, [&] { return handled == 2 && bus.undecodable() == 4; }));
  CHECK(bus.counters().at(0).received == 1);
  CHECK(bus.counters().at(0).undecodable == 4);
  CHECK(bus.counters().at(1).channel == "B");
  CHECK(bus.counters().at(1).received == 1);
  CHECK(bus.counters().at(1).undecodable == 0);
}

TEST_CASE("A handler's exception reaches the caller") {
  torquer::test::NeedPrivateNetwork();
  Bus bus;
  bus.Subscribe<instrument_command_t>(
      "A", [](const instrument_command_t&) { throw std::runtime_error("from the handler"); });
  bus.Publish("A", Command(1));
  CHECK_THROWS_WITH(HandleUntil(bus, [] { return false; }), "from the handler");
}

TEST_CASE("Health is reported at once on a change and when a second has passed") {
  torquer::test::NeedPrivateNetwork();
  Bus bus;
  std::vector<health_t> seen;
  bus.Subscribe<health_t>(torquer::protocol::kHealthChannel,
                          [&](const health_t& health) { seen.push_back(health); });
  torquer::bus::HealthReporter reporter(bus, "daemon");
  CHECK(reporter.Due(torquer::bus::MonotonicUs()));
  reporter.SetDevice("X-1");
  const std::int64_t before_us = torquer::bus::MonotonicUs();
  reporter.Change("running", "the device is here", {{"lost", 3}});
  CHECK_FALSE(reporter.Due(before_us + 999999));
  CHECK(reporter.Due(torquer::bus::MonotonicUs() + 1000000));
  reporter.Repeat({{"lost", 4}});
  REQUIRE(HandleUntil(bus, [&] { return seen.size() == 2; }));
  CHECK(seen[0].process == "daemon");
  CHECK(seen[0].device == "X-1");
  CHECK(seen[0].clock_id == torquer::bus::ClockId());
  CHECK(seen[0].publish_us >= before_us);
  CHECK(seen[0].state == "running");
  CHECK(seen[0].message == "the device is here");
  CHECK(seen[0].names == std::vector<std::string>{"lost"});
  CHECK(seen[0].values == std::vector<std::int64_t>{3});
  CHECK(seen[1].state == "running");
  CHECK(seen[1].message.empty());
  CHECK(seen[1].values == std::vector<std::int64_t>{4});
}

TEST_CASE("The clock id is positive and the clock runs forward") {
  CHECK(torquer::bus::ClockId() > 0);
  const std::int64_t before_us = torquer::bus::MonotonicUs();
  CHECK(torquer::bus::MonotonicUs() >= before_us);
}

TEST_CASE("Datagrams without a valid message are counted and reported, once a minute") {
  torquer::test::NeedPrivateNetwork();
  Bus bus;
  int handled = 0;
  bus.Subscribe<health_t>("B", [&](const health_t&) { ++handled; });
  CHECK(bus.TakeNotice(1).empty());

  const torquer::test::DatagramSocket stranger;
  stranger.Send(torquer::test::WholeDatagram("B", {1, 2, 3}));
  stranger.Send({'n', 'o', ' ', 'm', 'a', 'g', 'i', 'c'});
  // With these two, liblcm 1.3.1 writes out of bounds.
  const std::string channel("B\0", 2);
  stranger.Send(torquer::test::FragmentDatagram({1, 1000, 0, 0, 3}, channel + "ab"));
  stranger.Send(
      torquer::test::FragmentDatagram({1, 1000, 0xffffff00, 1, 3}, std::string(0x200, 'z')));
  bus.Publish("B", health_t{});
  REQUIRE(HandleUntil(bus, [&] { return handled == 1 && bus.undecodable() == 3; }));
  CHECK(bus.counters().at(0).undecodable == 1);

  const std::string from = "port " + std::to_string(stranger.port());
  CHECK(bus.TakeNotice(2) == "refused on the bus: 1 invalid messages on B, the last from " + from +
                                 "; 2 damaged datagrams, the last from " + from);
  stranger.Send(torquer::test::WholeDatagram("B", {1, 2, 3}));
  REQUIRE(HandleUntil(bus, [&] { return bus.undecodable() == 4; }));
  CHECK(bus.TakeNotice(60'000'001).empty());
  CHECK(bus.TakeNotice(60'000'002) ==
        "refused on the bus: 1 invalid messages on B, the last from " + from);
  CHECK(bus.TakeNotice(200'000'000).empty());
}

TEST_CASE("Mutated and random messages of every type end at the bus") {
  torquer::test::NeedPrivateNetwork();
  Bus bus;
  int handled = 0;
  const auto take = [&](const auto&) { ++handled; };
  bus.Subscribe<torquer_lcm::device_sample_t>("device_sample_t", take, 0);
  bus.Subscribe<torquer_lcm::hand_motion_t>("hand_motion_t", take, 0);
  bus.Subscribe<health_t>("health_t", take, 0);
  bus.Subscribe<torquer_lcm::imaging_command_t>("imaging_command_t", take, 0);
  bus.Subscribe<instrument_command_t>("instrument_command_t", take, 0);
  bus.Subscribe<torquer_lcm::picture_t>("picture_t", take, 0);
  bus.Subscribe<torquer_lcm::readings_t>("readings_t", take, 0);
  bus.Subscribe<torquer_lcm::scene_description_t>("scene_description_t", take, 0);
  bus.Subscribe<torquer_lcm::table_command_t>("table_command_t", take, 0);
  bus.Subscribe<torquer_lcm::injector_command_t>("injector_command_t", take, 0);
  bus.Subscribe<torquer_lcm::devices_t>("devices_t", take, 0);
  bus.Subscribe<torquer_lcm::exchange_command_t>("exchange_command_t", take, 0);
  bus.Subscribe<torquer_lcm::wedge_command_t>("wedge_command_t", take, 0);
  bus.Subscribe<torquer_lcm::vital_signs_t>("vital_signs_t", take, 0);
  bus.Subscribe<torquer_lcm::wire_forces_t>("wire_forces_t", take, 0);
  bus.Subscribe<torquer_lcm::wire_state_t>("wire_state_t", take, 0);
  const torquer::test::DatagramSocket stranger;
  std::mt19937 random(5);
  std::int64_t sent = 0;
  for (const torquer::test::SampleMessage& sample : torquer::test::SampleMessages()) {
    for (int round = 0; round < torquer::test::Rounds(200, 4); ++round) {
      torquer::test::Bytes bytes = sample.bytes;
      const std::size_t kept = round % 2 == 0 ? bytes.size() : 8;
      bytes.resize(kept + random() % 20);
      bytes[8 + random() % (bytes.size() - 7) - 1] = static_cast<std::uint8_t>(random());
      stranger.Send(torquer::test::WholeDatagram(sample.type, bytes));
      // Sends one at a time, so that no datagram is lost to a full buffer.
      ++sent;
      REQUIRE(HandleUntil(bus, [&] { return handled + bus.undecodable() == sent; }));
    }
  }
  CHECK(bus.undecodable() > 0);
  CHECK(handled > 0);
}

TEST_CASE("A message has its sender, and may be larger than a datagram") {
  torquer::test::NeedPrivateNetwork();
  Bus one;
  Bus other;
  Bus receiver;
  std::vector<std::pair<std::string, torquer::bus::Sender>> seen;
  receiver.SubscribeWithArrival<health_t>(
      "B", [&](const health_t& health, const torquer::bus::Arrival& arrival) {
        seen.emplace_back(health.message, arrival.sender);
        CHECK(arrival.received_us <= torquer::bus::MonotonicUs());
        CHECK(arrival.received_us > torquer::bus::MonotonicUs() - 120'000'000);
      });
  health_t health{};
  health.message = std::string(150'000, 'x');
  REQUIRE(one.Publish("B", health));
  REQUIRE(HandleUntil(receiver, [&] { return seen.size() == 1; }));
  CHECK(seen[0].first == health.message);
  REQUIRE(other.Publish("B", health_t{}));
  REQUIRE(HandleUntil(receiver, [&] { return seen.size() == 2; }));
  REQUIRE(one.Publish("B", health_t{}));
  REQUIRE(HandleUntil(receiver, [&] { return seen.size() == 3; }));
  CHECK(seen[0].second == seen[2].second);
  CHECK(seen[0].second != seen[1].second);
  // In this test's network, datagrams have no sender address.
  CHECK(Describe(seen[0].second).starts_with("port "));
}

TEST_CASE("A full queue drops the newest message, and reports it") {
  torquer::test::NeedPrivateNetwork();
  Bus sender;
  Bus receiver;
  std::vector<std::int64_t> seen;
  receiver.Subscribe<instrument_command_t>(
      "A", [&](const instrument_command_t& command) { seen.push_back(command.sequence); }, 3);
  int others = 0;
  receiver.Subscribe<health_t>("B", [&](const health_t&) { ++others; });
  for (std::int64_t k = 0; k < 10; ++k) sender.Publish("A", Command(k));
  sender.Publish("B", health_t{});
  // Waits until all have arrived before any is handled.
  for (int k = 0; k < 6000 && receiver.dropped() < 7; ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  REQUIRE(receiver.dropped() == 7);
  REQUIRE(HandleUntil(receiver, [&] { return others == 1; }));
  CHECK(seen == std::vector<std::int64_t>{0, 1, 2});
  CHECK(receiver.TakeNotice(1) ==
        "refused on the bus: 7 messages dropped, because they arrived too fast");
}
