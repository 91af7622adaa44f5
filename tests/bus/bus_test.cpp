#include "host/bus/bus.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <stdexcept>

#include "host/bus/clock.h"
#include "host/bus/health_reporter.h"
#include "host/support/error.h"
#include "protocol/lcm_channels.h"
#include "tests/support/private_network.h"
#include "torquer_lcm/hand_motion_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/instrument_command_t.hpp"

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

// Handles messages until `done` or a generous deadline.
template <class Done>
bool HandleUntil(Bus& bus, Done done) {
  for (int i = 0; i < 100 && !done(); ++i) bus.Handle(50);
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

TEST_CASE("What is published arrives, whole and in order") {
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
  lcm_publish(raw, "A", bytes.data(), 0);         // nothing at all
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
