// Commands on a live bus: authorized senders, refusals, and timeouts, with times given by the test.
#include "host/simulator/live_commands.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "host/bus/clock.h"
#include "protocol/lcm_channels.h"
#include "tests/support/scenes.h"

using torquer::bus::Sender;
using torquer::simulator::LiveCommands;
using torquer_lcm::instrument_command_t;

namespace {

constexpr Sender kHand{0, 1001};
constexpr Sender kStranger{0, 1002};
constexpr std::int64_t kStartUs = 50'000'000;

// A scene with a guidewire at 120 mm and a microcatheter at 60 mm.
class Fixture {
 public:
  Fixture() : file_(torquer::test::kMicrocatheter), scene_(file_.path()), simulation_(scene_) {}

  instrument_command_t Command(std::int64_t sequence, double insertion_mm) const {
    instrument_command_t command{};
    command.instrument = "guidewire";
    command.sequence = sequence;
    command.clock_id = torquer::bus::ClockId();
    command.origin_us = kStartUs - 2000;
    command.publish_us = kStartUs - 1000;
    command.insertion_mm = insertion_mm;
    return command;
  }
  double WantedMm(int instrument = 0) const {
    return commands().command().target[instrument].insertion_mm;
  }
  std::int64_t Count(const std::string& name) const {
    for (const auto& [counter, value] : commands().Counters()) {
      if (counter == name) return value.value();
    }
    return -1;
  }
  // True if the state after a tick reports that the command was refused.
  bool TickRefuses(const torquer::simulator::Command& command) {
    torquer::CountedBudget budget(1);
    simulation_.Tick(command, budget);
    return (simulation_.status() & torquer::protocol::kWireInputRefused) != 0;
  }
  LiveCommands& commands() { return commands_; }
  const LiveCommands& commands() const { return commands_; }
  torquer::simulator::Simulation& simulation() { return simulation_; }

 private:
  torquer::test::SceneFile file_;
  torquer::scene::Scene scene_;
  torquer::simulator::Simulation simulation_;
  LiveCommands commands_{scene_};
};

}  // namespace

TEST_CASE(
    "Without commands the pedals go up, the wire is held, and health names the missing sender",
    "[simulator]") {
  Fixture fixture;
  LiveCommands& commands = fixture.commands();
  // An instrument that was never commanded is not missing.
  commands.Age(kStartUs);
  CHECK(commands.State() == "running");
  CHECK_FALSE(commands.fresh());
  instrument_command_t command = fixture.Command(1, 7);
  command.xray = command.contrast = 1;
  command.lao_rad = 0.5;
  commands.Take(command, kHand, kStartUs);
  CHECK(commands.command().controls.xray);
  commands.Settle();
  commands.Age(kStartUs + 299'999);
  CHECK_FALSE(commands.fresh());
  CHECK_FALSE(commands.command().in_doubt);
  CHECK(commands.TakeNews().empty());

  commands.Age(kStartUs + 300'000);
  CHECK(commands.fresh());  // a state reports it, and the picture stops
  CHECK_FALSE(commands.command().controls.xray);
  CHECK_FALSE(commands.command().controls.contrast);
  CHECK(commands.command().controls.lao_rad == 0.5);
  CHECK(commands.command().in_doubt);
  CHECK(fixture.WantedMm() == 127);
  CHECK(commands.State() == "no commands for guidewire");
  CHECK(
      commands.TakeNews() ==
      "commands for the guidewire from port 1001 have stopped; it is held, and the pedals are up");
  commands.Settle();
  commands.Age(kStartUs + 900'000);
  CHECK_FALSE(commands.fresh());
  CHECK(commands.TakeNews().empty());

  command.sequence = 2;
  commands.Take(command, kHand, kStartUs + 900'000);
  CHECK(commands.command().controls.xray);
  CHECK_FALSE(commands.command().in_doubt);
  CHECK(commands.State() == "running");
  CHECK(commands.TakeNews() == "the guidewire receives commands again, from port 1001");
}

TEST_CASE("An instrument has one sender, until that is silent for a second", "[simulator]") {
  Fixture fixture;
  LiveCommands& commands = fixture.commands();
  commands.Take(fixture.Command(100, 1), kHand, kStartUs);
  for (int k = 0; k < 5; ++k) {
    commands.Take(fixture.Command(INT64_MAX, 50), kStranger, kStartUs + 1000 * k);
  }
  CHECK(fixture.WantedMm() == 121);
  CHECK(fixture.Count("refused_senders") == 5);
  CHECK(commands.TakeNews() ==
        "commands for the guidewire from port 1002 are refused, because it receives commands from "
        "port 1001");
  // The other instrument has no owner yet.
  instrument_command_t other = fixture.Command(3, 4);
  other.instrument = "microcatheter";
  commands.Take(other, kStranger, kStartUs + 5000);
  CHECK(fixture.WantedMm(1) == 64);
  // The owner continues, whatever sequence number the stranger used.
  commands.Take(fixture.Command(101, 2), kHand, kStartUs + 500'000);
  CHECK(fixture.WantedMm() == 122);
  commands.Take(fixture.Command(1, 3), kStranger, kStartUs + 1'499'999);
  CHECK(fixture.WantedMm() == 122);
  commands.Take(fixture.Command(1, 3), kStranger, kStartUs + 1'500'000);
  CHECK(fixture.WantedMm() == 123);
  CHECK(commands.TakeNews() == "the guidewire receives commands again, from port 1002");
  // Now the first sender is refused; within the same minute that is not reported again.
  commands.Take(fixture.Command(102, 9), kHand, kStartUs + 1'600'000);
  CHECK(fixture.WantedMm() == 123);
  CHECK(fixture.Count("refused_senders") == 7);
  CHECK(commands.TakeNews().empty());
}

TEST_CASE("The numbers of a sender never decrease, and block no other sender", "[simulator]") {
  Fixture fixture;
  LiveCommands& commands = fixture.commands();
  std::int64_t now_us = kStartUs;
  const auto taken = [&](std::int64_t sequence) {
    const std::int64_t before = commands.taken();
    commands.Take(fixture.Command(sequence, 1), kHand, now_us);
    return commands.taken() > before;
  };
  CHECK_FALSE(taken(-1));
  CHECK_FALSE(taken(INT64_MIN));
  CHECK(taken(5));
  CHECK(taken(6));
  CHECK(taken(6));  // repeated, as networks may do
  CHECK_FALSE(taken(5));
  CHECK_FALSE(taken(0));
  CHECK(taken(1000));  // the numbers between were lost
  CHECK(fixture.Count("refused_order") == 4);
  // The largest number, and its successor.
  now_us += LiveCommands::kOwnedUs;
  CHECK(taken(INT64_MAX));
  CHECK_FALSE(taken(INT64_MAX - 1));
  CHECK(torquer::protocol::NextSequence(INT64_MAX) == 0);
  CHECK(torquer::protocol::NextSequence(41) == 42);
  CHECK(taken(0));
  CHECK(taken(1));
  CHECK_FALSE(taken(INT64_MAX));
  // A stream with only such numbers counts as silent, and after one second it starts over.
  now_us += LiveCommands::kOwnedUs - 1;
  CHECK_FALSE(taken(INT64_MAX));
  now_us += 1;
  CHECK(taken(INT64_MAX));
}

TEST_CASE("Impossible values are refused field by field, and the last good ones stay",
          "[simulator]") {
  using Field = double instrument_command_t::*;
  const auto [field, limit] = GENERATE(table<Field, double>({
      {&instrument_command_t::insertion_mm, 1e5},
      {&instrument_command_t::rotation_rad, 1e5},
      {&instrument_command_t::lao_rad, 3.15},
      {&instrument_command_t::cra_rad, 3.15},
  }));
  Fixture fixture;
  LiveCommands& commands = fixture.commands();
  instrument_command_t good = fixture.Command(1, 7);
  good.rotation_rad = 1;
  good.lao_rad = 0.5;
  good.cra_rad = -0.5;
  commands.Take(good, kHand, kStartUs);
  const std::vector<double> hostile = {std::nan(""),
                                       std::numeric_limits<double>::infinity(),
                                       -std::numeric_limits<double>::infinity(),
                                       std::numeric_limits<double>::max(),
                                       1.01 * limit,
                                       -1.01 * limit};
  for (const double value : hostile) {
    instrument_command_t command = good;
    command.sequence = good.sequence + 1;
    command.*field = value;
    command.xray = 1;
    commands.Take(command, kHand, kStartUs + 1000);
    CHECK(commands.command().refused);
    CHECK(fixture.WantedMm() == 127);
    CHECK(commands.command().target[0].rotation_rad == 1);
    CHECK(commands.command().controls.lao_rad == 0.5);
    CHECK(commands.command().controls.cra_rad == -0.5);
    CHECK_FALSE(commands.command().controls.xray);
    CHECK(fixture.TickRefuses(commands.command()));
    good.sequence += 2;
    commands.Take(good, kHand, kStartUs + 2000);
    CHECK_FALSE(fixture.TickRefuses(commands.command()));
  }
  CHECK(fixture.Count("refused_values") == static_cast<std::int64_t>(hostile.size()));
  CHECK_THAT(commands.TakeNews(),
             Catch::StartsWith("a command for the guidewire from port 1001 is refused, and the "
                               "previous one remains valid: "));
  // A sender of refused commands only counts as silent.
  instrument_command_t bad = good;
  bad.sequence += 1;
  bad.*field = std::nan("");
  commands.Take(bad, kHand, kStartUs + 302'000);
  commands.Age(kStartUs + 302'000);
  CHECK(commands.State() == "no commands for guidewire");
}

TEST_CASE("Angles that cannot be are refused by the simulation itself", "[simulator]") {
  Fixture fixture;
  torquer::simulator::Command command = fixture.commands().command();
  command.controls.lao_rad = std::nan("");
  CHECK(fixture.TickRefuses(command));
  command.controls.lao_rad = 0;
  command.controls.cra_rad = -4;
  CHECK(fixture.TickRefuses(command));
  command.controls.cra_rad = -3;
  CHECK_FALSE(fixture.TickRefuses(command));
}

TEST_CASE("Times that cannot be are replaced by that of arrival", "[simulator]") {
  Fixture fixture;
  for (const std::int64_t time_us : {INT64_MIN, std::int64_t{-1}, kStartUs + 1, INT64_MAX}) {
    instrument_command_t command = fixture.Command(1, 7);
    command.origin_us = command.publish_us = time_us;
    fixture.commands().Take(command, kHand, kStartUs);
    torquer_lcm::wire_state_t state{};
    fixture.simulation().Describe(state);
    fixture.commands().Describe(state);
    CHECK(state.instruments[0].origin_us == kStartUs);
    CHECK(fixture.commands().sent_us() == 0);
  }
}

TEST_CASE("Settings of the X-ray system stay when their sender is silent", "[simulator]") {
  Fixture fixture;
  LiveCommands& commands = fixture.commands();
  torquer_lcm::imaging_command_t chosen{};
  chosen.sequence = 5;
  chosen.mode = torquer::protocol::kImagingCine;
  chosen.pulses_per_s = 7.5;
  chosen.magnification = 2;
  const double shutters[] = {0.1, 0.2, 0.3, 0.4};
  std::copy(std::begin(shutters), std::end(shutters), std::begin(chosen.shutters));
  const auto imaging = [&] { return commands.command().controls.imaging; };

  commands.Take(chosen, kHand, kStartUs);
  CHECK(commands.fresh());
  CHECK(imaging().mode == torquer::effects::Imaging::Mode::kCine);
  CHECK(imaging().pulses_per_s == 7.5);
  CHECK(imaging().magnification == 2);
  CHECK(imaging().left == 0.1);
  CHECK(imaging().right == 0.2);
  CHECK(imaging().top == 0.3);
  CHECK(imaging().bottom == 0.4);
  commands.Settle();

  // A repeated choice is not fresh. An instrument's command and silence leave the choice unchanged.
  ++chosen.sequence;
  commands.Take(chosen, kHand, kStartUs + 1000);
  CHECK_FALSE(commands.fresh());
  commands.Take(fixture.Command(1, 3), kStranger, kStartUs + 2000);
  CHECK(imaging().magnification == 2);
  commands.Age(kStartUs + 10'000'000);
  CHECK(imaging().magnification == 2);
  CHECK_THAT(commands.State(), Catch::Contains("no commands for guidewire"));
}

TEST_CASE("Wedges and the other settings of the X-ray system do not change each other",
          "[simulator]") {
  Fixture fixture;
  LiveCommands& commands = fixture.commands();
  torquer_lcm::wedge_command_t placed{};
  placed.sequence = 5;
  placed.share[0] = 0.3;
  placed.share[1] = 0.2;
  placed.rotation_deg[0] = -30;
  placed.rotation_deg[1] = 90;
  torquer_lcm::imaging_command_t chosen{};
  chosen.magnification = 2;
  const auto imaging = [&] { return commands.command().controls.imaging; };
  const auto are_placed = [&] {
    return imaging().wedges[0] == torquer::effects::Wedge{0.3, -30} &&
           imaging().wedges[1] == torquer::effects::Wedge{0.2, 90};
  };
  commands.Take(placed, kHand, kStartUs);
  CHECK(commands.fresh());
  CHECK(are_placed());
  commands.Settle();
  commands.Take(chosen, kStranger, kStartUs + 1000);
  CHECK(commands.fresh());
  CHECK(are_placed());
  ++placed.sequence;
  commands.Take(placed, kHand, kStartUs + 2000);
  CHECK(imaging().magnification == 2);

  commands.TakeNews();
  using Message = torquer_lcm::wedge_command_t;
  void (*const spoilers[])(Message&) = {
      [](Message& m) { m.share[0] = 0.6; }, [](Message& m) { m.share[1] = -0.1; },
      [](Message& m) { m.share[1] = std::nan(""); }, [](Message& m) { m.rotation_deg[0] = 91; },
      [](Message& m) { m.rotation_deg[1] = -std::numeric_limits<double>::infinity(); }};
  for (const auto spoil : spoilers) {
    Message bad = placed;
    bad.sequence = ++placed.sequence;
    spoil(bad);
    commands.Take(bad, kHand, kStartUs + 3000);
    CHECK(are_placed());
  }
  CHECK(fixture.Count("refused_values") == std::ssize(spoilers));
  CHECK_THAT(commands.TakeNews(),
             Catch::Contains("wedge filters") &&
                 Catch::Contains("share 0.6 0.2, rotation_deg -30 90; give share 0 to 0.5, "
                                 "rotation_deg -90 to 90"));
  commands.Take(placed, kStranger, kStartUs + 4000);
  CHECK(fixture.Count("refused_senders") == 1);
}

TEST_CASE("The sender of the innermost instrument moves the table, and its place stays",
          "[simulator]") {
  Fixture fixture;
  LiveCommands& commands = fixture.commands();
  torquer_lcm::table_command_t moved{};
  moved.instrument = "guidewire";
  moved.sequence = 7;
  moved.left_mm = -30;
  moved.head_mm = 200;
  moved.height_mm = 15;
  const auto is_at = [&](double left_mm, double head_mm, double height_mm) {
    const torquer::effects::Table& table = commands.command().controls.table;
    return table.left_mm == left_mm && table.head_mm == head_mm && table.height_mm == height_mm;
  };
  commands.Take(moved, kHand, kStartUs);
  CHECK(is_at(-30, 200, 15));
  CHECK(commands.fresh());
  commands.Settle();

  // A repeated place is not fresh. Commands of instruments and silence leave the table there.
  ++moved.sequence;
  commands.Take(moved, kHand, kStartUs + 1000);
  CHECK_FALSE(commands.fresh());
  commands.Take(fixture.Command(1, 3), kHand, kStartUs + 2000);
  CHECK(is_at(-30, 200, 15));

  // Refused: another sender, a number before the last, a place out of reach, another instrument.
  const auto refused = [&](const torquer::bus::Sender& sender, auto change) {
    torquer_lcm::table_command_t bad = moved;
    bad.sequence = ++moved.sequence;
    bad.left_mm = 1;
    change(bad);
    commands.Take(bad, sender, kStartUs + 3000);
    return is_at(-30, 200, 15);
  };
  CHECK(refused(kStranger, [](auto&) {}));
  CHECK_THAT(commands.TakeNews(), Catch::Contains("table") && Catch::Contains("refused"));
  CHECK(refused(kHand, [](auto& bad) { bad.sequence = 6; }));
  CHECK(refused(kHand, [](auto& bad) { bad.height_mm = 151; }));
  CHECK_THAT(commands.TakeNews(), Catch::Contains("height_mm 151"));
  CHECK(refused(kHand, [](auto& bad) { bad.head_mm = std::nan(""); }));
  CHECK(refused(kHand, [](auto& bad) { bad.instrument = "catheter"; }));
  commands.Age(kStartUs + 10'000'000);
  CHECK(is_at(-30, 200, 15));
}

TEST_CASE("The X-ray system has one sender, and impossible settings are refused and named",
          "[simulator]") {
  Fixture fixture;
  LiveCommands& commands = fixture.commands();
  torquer_lcm::imaging_command_t chosen{};
  chosen.sequence = 5;
  chosen.magnification = 2;
  const auto magnification = [&] { return commands.command().controls.imaging.magnification; };
  commands.Take(chosen, kHand, kStartUs);
  commands.TakeNews();

  chosen.magnification = 3;
  chosen.sequence = 9;
  commands.Take(chosen, kStranger, kStartUs + 500'000);
  CHECK(magnification() == 2);
  CHECK(fixture.Count("refused_senders") == 1);
  CHECK_THAT(commands.TakeNews(), Catch::Contains("X-ray system") && Catch::Contains("refused"));
  chosen.sequence = 4;
  commands.Take(chosen, kHand, kStartUs + 500'000);
  CHECK(magnification() == 2);
  CHECK(fixture.Count("refused_order") == 1);
  commands.TakeNews();

  chosen.sequence = 6;
  const auto refused = [&](auto change) {
    torquer_lcm::imaging_command_t bad = chosen;
    ++chosen.sequence;
    change(bad);
    const std::int64_t before = fixture.Count("refused_values");
    commands.Take(bad, kHand, kStartUs + 600'000);
    return fixture.Count("refused_values") == before + 1 && magnification() == 2;
  };
  CHECK(refused([](auto& bad) { bad.mode = 5; }));
  CHECK(refused([](auto& bad) { bad.mode = -1; }));
  CHECK(refused([](auto& bad) { bad.magnification = 0; }));
  CHECK(refused([](auto& bad) { bad.pulses_per_s = std::numeric_limits<double>::infinity(); }));
  CHECK(refused([](auto& bad) { bad.shutters[3] = 0.5; }));
  CHECK_THAT(commands.TakeNews(), Catch::Contains("mode 5"));

  // After a sender falls silent only its choice stays; another may take over with any number.
  commands.Take(chosen, kStranger, kStartUs + 5'000'000);
  CHECK(magnification() == 3);
}
