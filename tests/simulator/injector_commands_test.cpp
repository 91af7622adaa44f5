// Commands on a live bus to the power injector, with times given by the test.
#include <catch2/catch.hpp>
#include <cmath>
#include <iterator>

#include "host/simulator/live_commands.h"
#include "protocol/lcm_channels.h"
#include "tests/support/scenes.h"

using torquer::bus::Sender;
using torquer::effects::Injector;
using torquer::simulator::LiveCommands;
using torquer_lcm::injector_command_t;

namespace {

constexpr Sender kInjectorPage{0, 1001};
constexpr Sender kOtherPage{0, 1002};
constexpr std::int64_t kOrderedUs = 50'000'000;

class InjectorFixture {
 public:
  InjectorFixture() : file_(torquer::test::kMicrocatheter), scene_(file_.path()) {}
  LiveCommands& commands() { return commands_; }
  const Injector& injector() const { return commands_.command().controls.injector; }

 private:
  torquer::test::SceneFile file_;
  torquer::scene::Scene scene_;
  LiveCommands commands_{scene_};
};

injector_command_t OrderFor(std::int64_t sequence, std::int32_t order) {
  injector_command_t command{};
  command.sequence = sequence;
  command.order = order;
  command.volume_mL = 12;
  command.rate_mL_s = 3;
  command.delay_s = 0.5;
  command.rise_s = -1;
  return command;
}

}  // namespace

TEST_CASE("A silent sender of the power injector stops it, and the set-up stays", "[simulator]") {
  InjectorFixture fixture;
  LiveCommands& commands = fixture.commands();
  CHECK(fixture.injector() == Injector{});
  commands.Take(OrderFor(1, torquer::protocol::kInjectorInject), kInjectorPage, kOrderedUs);
  CHECK(commands.fresh());
  CHECK(fixture.injector() == Injector{Injector::Order::kInject, 12, 3, 0.5, -1});
  // Commands for an instrument do not change it.
  torquer_lcm::instrument_command_t hand{};
  hand.instrument = "guidewire";
  commands.Take(hand, kOtherPage, kOrderedUs + 1000);
  commands.Age(kOrderedUs + LiveCommands::kSilentUs - 1);
  CHECK(fixture.injector().order == Injector::Order::kInject);
  commands.Settle();
  commands.TakeNews();
  commands.Age(kOrderedUs + LiveCommands::kSilentUs);
  CHECK(fixture.injector() == Injector{Injector::Order::kOff, 12, 3, 0.5, -1});
  CHECK(commands.fresh());
  CHECK_THAT(commands.TakeNews(),
             Catch::Contains("the power injector") && Catch::Contains("have stopped; it is off"));
  commands.Take(OrderFor(2, torquer::protocol::kInjectorArm), kInjectorPage, kOrderedUs + 400'000);
  CHECK(fixture.injector().order == Injector::Order::kArm);
  commands.Age(kOrderedUs + 400'000 + LiveCommands::kSilentUs);
  CHECK(fixture.injector().order == Injector::Order::kOff);
}

TEST_CASE("Bad commands for the power injector are refused with field, value and remedy",
          "[simulator]") {
  InjectorFixture fixture;
  LiveCommands& commands = fixture.commands();
  injector_command_t command = OrderFor(1, torquer::protocol::kInjectorArm);
  commands.Take(command, kInjectorPage, kOrderedUs);
  const Injector before = fixture.injector();
  const struct {
    void (*spoil)(injector_command_t&);
    const char* news;
  } cases[] = {
      {[](injector_command_t& c) { c.order = 3; }, "order 3; give 0 to 2"},
      {[](injector_command_t& c) { c.order = -1; }, "order -1; give 0 to 2"},
      {[](injector_command_t& c) { c.volume_mL = 151; }, "volume_mL 151; give 0.1 to 150"},
      {[](injector_command_t& c) { c.rate_mL_s = 0; }, "rate_mL_s 0; give 0.1 to 45"},
      {[](injector_command_t& c) { c.delay_s = 100; }, "delay_s 100; give 0 to 99.9"},
      {[](injector_command_t& c) { c.rise_s = std::nan(""); }, "rise_s nan; give 0 to 9.9"}};
  std::int64_t now_us = kOrderedUs;
  for (const auto& one : cases) {
    INFO(one.news);
    injector_command_t bad = OrderFor(command.sequence + 1, torquer::protocol::kInjectorInject);
    command.sequence += 2;
    one.spoil(bad);
    now_us += 61'000'000;  // each kind of refusal is reported once a minute
    commands.Take(bad, kInjectorPage, now_us);
    CHECK_THAT(commands.TakeNews(), Catch::Contains(one.news));
    CHECK(fixture.injector() == before);
  }
  commands.Take(command, kInjectorPage, now_us);
  commands.Take(OrderFor(1, torquer::protocol::kInjectorInject), kOtherPage, now_us + 1000);
  CHECK(fixture.injector() == before);
  CHECK_THAT(commands.TakeNews(), Catch::Contains("commands for the power injector"));
}
