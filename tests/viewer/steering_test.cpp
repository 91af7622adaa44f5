#include "host/viewer/steering.h"

#include <catch2/catch.hpp>
#include <utility>

#include "protocol/lcm_channels.h"

using namespace torquer::viewer;

namespace {

constexpr std::int64_t kStart = 1'000'000;

// Wire of 300 mm, inserted by 100 mm at the start and moved since.
Steering Placed() {
  Steering steering(77);
  torquer_lcm::scene_description_t scene{};
  scene.instrument_count = 2;
  scene.instruments = {"guidewire", "catheter"};
  scene.max_length_mm = {300, 200};
  scene.inserted_at_start_mm = {100, 50};
  steering.Add(scene);
  torquer_lcm::wire_state_t state{};
  state.instrument_count = 2;
  state.instruments.resize(2);
  state.instruments[0].inserted_at_start_mm = 100;
  state.instruments[0].commanded_insertion_mm = 130;
  state.instruments[0].commanded_rotation_rad = 2;
  state.instruments[0].command_sequence = 40;
  state.instruments[1].inserted_at_start_mm = 50;
  state.instruments[1].commanded_insertion_mm = 50;
  state.instruments[1].command_sequence = -1;
  steering.Add(state);
  return steering;
}

Controls Push(double mm_s, int instrument = 0) {
  Controls controls;
  controls.push_mm_s = mm_s;
  controls.instrument = instrument;
  return controls;
}

// Keys held for a time: a message every 100 ms, the loop every 8 ms.
void Hold(Steering& steering, PageId page, const Controls& controls, std::int64_t from_us,
          std::int64_t to_us) {
  for (std::int64_t now = from_us; now < to_us; now += 4000) {
    if ((now - from_us) % 100'000 == 0) steering.Take(page, controls, now);
    if ((now - from_us) % 8000 == 0) steering.Advance(now);
  }
  steering.Advance(to_us);
}

}  // namespace

TEST_CASE("Steering begins where the instruments are, and before a state not at all") {
  Steering nothing(1);
  CHECK(nothing.Commands(kStart).empty());
  Steering steering = Placed();
  const auto commands = steering.Commands(kStart);
  REQUIRE(commands.size() == 2);
  CHECK(commands[0].insertion_mm == 30);
  CHECK(commands[0].rotation_rad == 2);
  CHECK(commands[0].sequence == 41);
  CHECK(commands[0].clock_id == 77);
  CHECK(commands[1].instrument == "catheter");
  CHECK(commands[1].insertion_mm == 0);
}

TEST_CASE("A held key gives the same motion at any rate of the loop") {
  Steering steering = Placed();
  Controls controls = Push(20, 1);
  controls.turn_rad_s = -2;
  controls.lao_rad_s = 0.5;
  Hold(steering, 1, controls, kStart, kStart + 2'000'000);
  const auto commands = steering.Commands(kStart + 2'000'000);
  CHECK(commands[0].insertion_mm == 30);
  CHECK(commands[1].insertion_mm == Approx(40));
  CHECK(commands[1].rotation_rad == Approx(-4));
  CHECK(commands[0].lao_rad == Approx(1));
  CHECK(commands[0].flags == 0);
}

TEST_CASE("A silent page stops all motion, and its pedals go up") {
  Steering steering = Placed();
  Controls controls = Push(100);
  controls.xray = controls.contrast = true;
  steering.Take(1, controls, kStart);
  CHECK(steering.Commands(kStart)[0].xray);
  // A late loop does not extend the effect of the last message.
  steering.Advance(kStart + 5'000'000);
  const auto commands = steering.Commands(kStart + 5'000'000);
  CHECK(commands[0].insertion_mm == Approx(30 + 100 * 0.3));
  CHECK_FALSE(commands[0].xray);
  CHECK_FALSE(commands[0].contrast);
  CHECK(commands[0].flags == torquer::protocol::kCommandNoDevice);
  CHECK_FALSE(steering.page());
}

TEST_CASE("A page that leaves releases its controls at once") {
  Steering steering = Placed();
  Controls controls;
  controls.xray = true;
  steering.Take(1, controls, kStart);
  steering.Leave(2);
  CHECK(steering.xray());
  steering.Leave(1);
  CHECK_FALSE(steering.Commands(kStart)[0].xray);
  CHECK(steering.Take(2, controls, kStart));
}

TEST_CASE("One page steers at a time") {
  Steering steering = Placed();
  CHECK(steering.Take(1, Push(10), kStart));
  CHECK_FALSE(steering.Take(2, Push(-10), kStart + 100'000));
  steering.Advance(kStart + 200'000);
  CHECK(steering.Commands(kStart + 200'000)[0].insertion_mm == Approx(32));
  steering.Advance(kStart + 1'200'000);
  CHECK(steering.Take(2, Push(-10), kStart + 1'200'000));
}

TEST_CASE("An instrument is not pushed beyond its length, nor the C-arm beyond its travel") {
  Steering steering = Placed();
  Controls controls = Push(200);
  controls.cra_rad_s = -2;
  Hold(steering, 1, controls, kStart, kStart + 3'000'000);
  CHECK(steering.Commands(kStart)[0].insertion_mm == 200);
  CHECK(steering.cra_rad() == Approx(-Steering::kCraLimitRad));
  Hold(steering, 1, Push(-200), kStart + 3'000'000, kStart + 6'000'000);
  CHECK(steering.Commands(kStart)[0].insertion_mm == -100);
}

TEST_CASE("An instrument that does not exist is not taken") {
  Steering steering = Placed();
  CHECK_FALSE(steering.Take(1, Push(1, 2), kStart));
  CHECK_FALSE(steering.page());
}

TEST_CASE("A setting of the X-ray system is always sent, once it is chosen") {
  Steering steering = Placed();
  CHECK(steering.ImagingCommand(kStart) == nullptr);
  torquer::effects::Imaging imaging;
  imaging.mode = torquer::effects::Imaging::Mode::kSubtraction;
  imaging.pulses_per_s = 7.5;
  imaging.magnification = 1.5;
  imaging.left = 0.1;
  imaging.bottom = 0.3;
  CHECK(steering.WedgeCommand(kStart) == nullptr);
  REQUIRE(steering.Take(3, {imaging, 70}));
  const auto* command = steering.ImagingCommand(kStart + 10);
  REQUIRE(command != nullptr);
  CHECK(command->mode == torquer::protocol::kImagingSubtraction);
  CHECK(command->pulses_per_s == 7.5);
  CHECK(command->magnification == 1.5);
  CHECK(command->shutters[0] == 0.1);
  CHECK(command->shutters[1] == 0);
  CHECK(command->shutters[3] == 0.3);
  CHECK(command->clock_id == 77);
  CHECK(command->publish_us == kStart + 10);
  CHECK(steering.WedgeCommand(kStart + 10) == nullptr);
  const std::int64_t first = command->sequence;
  CHECK(steering.ImagingCommand(kStart + 20)->sequence == first + 1);

  // While one page steers, another cannot choose; silence changes nothing.
  steering.Take(3, Push(1), kStart);
  imaging.magnification = 3;
  CHECK_FALSE(steering.Take(4, {imaging, 80}));
  CHECK(steering.AnsweredChoices() == std::vector<std::uint32_t>{70, 80});
  steering.Advance(kStart + 5'000'000);
  CHECK(steering.ImagingCommand(kStart + 5'000'000)->magnification == 1.5);
  CHECK(steering.Take(4, {imaging, 81}));
  CHECK(steering.imaging().magnification == 3);
  CHECK(steering.AnsweredChoices() == std::vector<std::uint32_t>{70, 81});
  steering.Leave(3);
  CHECK(steering.AnsweredChoices() == std::vector<std::uint32_t>{81});
}

TEST_CASE("A case begins with the plain display, and keeps all else as its scene has it") {
  Steering steering = Placed();
  steering.ChoosePlain();
  const auto* command = steering.ImagingCommand(kStart);
  REQUIRE(command != nullptr);
  CHECK(command->mode == torquer::protocol::kImagingPlain);
  CHECK(command->pulses_per_s == 0);
  CHECK(command->magnification == 1);
  steering.Restart();
  CHECK(steering.ImagingCommand(kStart) == nullptr);
}

TEST_CASE("While its pedal is down an acquisition has its own display and pulses") {
  using Mode = torquer::effects::Imaging::Mode;
  Steering steering = Placed();
  Controls controls;
  controls.acquisition = true;
  // Without a choice it is cine.
  REQUIRE(steering.Take(3, controls, kStart));
  CHECK(steering.xray());
  CHECK(steering.Commands(kStart)[0].xray);
  REQUIRE(steering.ImagingCommand(kStart) != nullptr);
  CHECK(steering.ImagingCommand(kStart)->mode == static_cast<int>(Mode::kCine));
  CHECK(steering.ImagingCommand(kStart)->pulses_per_s == 15);
  ImagingChoice choice{{.mode = Mode::kRoadmap, .pulses_per_s = 7.5, .magnification = 2}, 1};
  choice.acquisition = {Mode::kSubtraction, 3};
  REQUIRE(steering.Take(3, choice));
  CHECK(steering.ImagingCommand(kStart)->mode == static_cast<int>(Mode::kSubtraction));
  CHECK(steering.ImagingCommand(kStart)->pulses_per_s == 3);
  CHECK(steering.ImagingCommand(kStart)->magnification == 2);
  CHECK(steering.imaging().mode == Mode::kRoadmap);
  // Both pedals: the acquisition goes on. Then the X-ray pedal alone, with the chosen settings.
  controls.xray = true;
  REQUIRE(steering.Take(3, controls, kStart));
  CHECK(steering.ImagingCommand(kStart)->mode == static_cast<int>(Mode::kSubtraction));
  controls.acquisition = false;
  REQUIRE(steering.Take(3, controls, kStart));
  CHECK(steering.xray());
  CHECK(steering.ImagingCommand(kStart)->mode == static_cast<int>(Mode::kRoadmap));
  CHECK(steering.ImagingCommand(kStart)->pulses_per_s == 7.5);
  // A silent page lifts this pedal too.
  controls = {.acquisition = true};
  REQUIRE(steering.Take(3, controls, kStart));
  steering.Advance(kStart + Steering::kSilentUs);
  CHECK_FALSE(steering.xray());
  CHECK(steering.ImagingCommand(kStart)->mode == static_cast<int>(Mode::kRoadmap));
  steering.Restart();
  CHECK(steering.ImagingCommand(kStart) == nullptr);
  CHECK(steering.acquisition().mode == Mode::kCine);
}

TEST_CASE("Positions of the wedges are sent once one has moved") {
  Steering steering = Placed();
  torquer::effects::Imaging imaging;
  REQUIRE(steering.Take(3, {imaging, 1}));
  CHECK(steering.WedgeCommand(kStart) == nullptr);
  imaging.wedges = {{{0.3, -30}, {0.1, 60}}};
  REQUIRE(steering.Take(3, {imaging, 2}));
  const auto* command = steering.WedgeCommand(kStart + 10);
  REQUIRE(command != nullptr);
  CHECK(command->share[0] == 0.3);
  CHECK(command->share[1] == 0.1);
  CHECK(command->rotation_deg[0] == -30);
  CHECK(command->rotation_deg[1] == 60);
  CHECK(command->clock_id == 77);
  CHECK(command->publish_us == kStart + 10);
  const std::int64_t first = command->sequence;
  // Out again, and it is still sent.
  REQUIRE(steering.Take(3, ImagingChoice{{}, 3}));
  command = steering.WedgeCommand(kStart + 20);
  REQUIRE(command != nullptr);
  CHECK(command->sequence == first + 1);
  CHECK(command->share[0] == 0);
  steering.Restart();
  CHECK(steering.WedgeCommand(kStart + 30) == nullptr);
}

TEST_CASE("An order to the power injector stands while its page is there") {
  using torquer::effects::Injector;
  using Order = Injector::Order;
  Steering steering = Placed();
  CHECK(steering.InjectorCommand(kStart) == nullptr);
  REQUIRE(steering.Take(3, Injector{Order::kArm, 12, 3, 0.5, 0.25}));
  const auto* command = steering.InjectorCommand(kStart + 10);
  REQUIRE(command != nullptr);
  CHECK(command->order == torquer::protocol::kInjectorArm);
  CHECK(command->volume_mL == 12);
  CHECK(command->rate_mL_s == 3);
  CHECK(command->delay_s == 0.5);
  CHECK(command->rise_s == 0.25);
  CHECK(command->clock_id == 77);
  CHECK(command->publish_us == kStart + 10);
  const std::int64_t first = command->sequence;
  const auto order = [&] { return steering.InjectorCommand(kStart + 20)->order; };

  // While another page steers, this one can only stop.
  steering.Take(4, Push(1), kStart);
  CHECK_FALSE(steering.Take(3, Injector{.order = Order::kInject}));
  CHECK(order() == torquer::protocol::kInjectorArm);
  CHECK(steering.InjectorCommand(kStart)->sequence == first + 2);
  CHECK(steering.Take(3, Injector{.order = Order::kOff}));
  CHECK(order() == torquer::protocol::kInjectorOff);
  CHECK_FALSE(steering.Take(5, Injector{.order = Order::kOff}));
  REQUIRE(steering.Take(4, Injector{.order = Order::kInject}));
  steering.Leave(3);
  CHECK(order() == torquer::protocol::kInjectorInject);
  steering.Leave(4);
  CHECK(order() == torquer::protocol::kInjectorOff);
  steering.Restart();
  CHECK(steering.InjectorCommand(kStart) == nullptr);
}

TEST_CASE("An order to exchange is repeated for a time, with its own number") {
  Steering steering = Placed();
  CHECK(steering.ExchangeCommand(kStart) == nullptr);
  CHECK_FALSE(steering.Take(3, ExchangeChoice{2, "sion"}, kStart));
  REQUIRE(steering.Take(3, ExchangeChoice{1, "guiding_6f"}, kStart));
  const auto* command = steering.ExchangeCommand(kStart + 10);
  REQUIRE(command != nullptr);
  CHECK(command->instrument == "catheter");
  CHECK(command->device == "guiding_6f");
  CHECK(command->clock_id == 77);
  CHECK(command->publish_us == kStart + 10);
  const auto [order, sequence] = std::pair(command->order, command->sequence);
  command = steering.ExchangeCommand(kStart + Steering::kOrderUs);
  REQUIRE(command != nullptr);
  CHECK(command->order == order);
  CHECK(command->sequence == sequence + 1);
  CHECK(steering.ExchangeCommand(kStart + Steering::kOrderUs + 1) == nullptr);
  // The same choice again is another order.
  REQUIRE(steering.Take(3, ExchangeChoice{1, "guiding_6f"}, kStart + 5'000'000));
  CHECK(steering.ExchangeCommand(kStart + 5'000'000)->order == order + 1);
  // While another page steers, this one cannot order.
  steering.Take(4, Push(1), kStart + 5'000'000);
  CHECK_FALSE(steering.Take(3, ExchangeChoice{0, "sion"}, kStart + 5'000'000));
  CHECK(steering.Take(4, ExchangeChoice{0, "sion"}, kStart + 5'000'000));
  CHECK(steering.ExchangeCommand(kStart + 5'000'000)->instrument == "guidewire");
  steering.Restart();
  CHECK(steering.ExchangeCommand(kStart + 5'000'000) == nullptr);
}

TEST_CASE("The steering page moves the table at its rate, and it stops with the page") {
  Steering steering = Placed();
  CHECK_FALSE(steering.Take(3, TableMotion{.left_mm_s = 40}, kStart));
  torquer_lcm::readings_t readings{};
  readings.names = {"air_kerma_mGy", "table_left_mm", "table_height_mm"};
  readings.values = {7, 10, -4};
  readings.count = 3;
  steering.Add(readings);
  CHECK(steering.TableCommand(kStart, true) == nullptr);

  const auto beat = [&](const TableMotion& motion, int beats, std::int64_t from_us) {
    for (int k = 0; k < beats; ++k) {
      steering.Take(3, Push(0), from_us + 100'000 * k);
      REQUIRE(steering.Take(3, motion, from_us + 100'000 * k));
    }
    steering.Advance(from_us + 100'000 * beats);
  };
  beat({.left_mm_s = 40, .head_mm_s = -20, .height_mm_s = 10}, 5, kStart);
  const auto* command = steering.TableCommand(kStart + 500'000, false);
  REQUIRE(command != nullptr);
  CHECK(command->instrument == "guidewire");
  CHECK(command->left_mm == Approx(10 + 20));
  CHECK(command->head_mm == Approx(-10));
  CHECK(command->height_mm == Approx(-4 + 5));
  CHECK(command->clock_id == 77);
  const std::int64_t first = command->sequence;
  CHECK(steering.TableCommand(kStart + 500'000, false) == nullptr);
  CHECK(steering.TableCommand(kStart + 500'000, true)->sequence == first + 1);

  // Readings that still come from the time before do not move it back.
  steering.Add(readings);
  CHECK(steering.TableCommand(kStart + 500'000, true)->left_mm == Approx(30));
  // The last message is valid for 300 ms, of which 100 ms have passed.
  steering.Advance(kStart + 5'000'000);
  CHECK(steering.TableCommand(kStart + 5'000'000, true)->left_mm == Approx(30 + 8));
  // Its travel ends at 150, 500 and 150 mm.
  beat({.left_mm_s = 100, .head_mm_s = 100, .height_mm_s = -100}, 80, kStart + 6'000'000);
  command = steering.TableCommand(kStart + 14'000'000, true);
  CHECK(command->left_mm == 150);
  CHECK(command->head_mm == 500);
  CHECK(command->height_mm == -150);
  steering.Restart();
  CHECK(steering.TableCommand(kStart + 14'000'000, true) == nullptr);
}

TEST_CASE("Another simulator is steered from where its instruments are, by who steered before") {
  Steering steering = Placed();
  torquer::effects::Imaging imaging;
  imaging.magnification = 2;
  REQUIRE(steering.Take(3, {imaging, 1}));
  Controls controls = Push(40);
  controls.xray = true;
  controls.lao_rad_s = 1;
  Hold(steering, 3, controls, kStart, kStart + 500'000);
  REQUIRE(steering.Commands(kStart + 500'000)[0].insertion_mm > 40);
  steering.Restart();
  CHECK(steering.page() == 3);
  CHECK(steering.Commands(kStart + 500'000).empty());
  CHECK(steering.ImagingCommand(kStart + 500'000) == nullptr);
  CHECK(steering.AnsweredChoices() == std::vector<std::uint32_t>{1});
  CHECK(steering.lao_rad() == 0);
  CHECK_FALSE(steering.xray());
  // The same instruments as before.
  torquer_lcm::scene_description_t scene{};
  scene.instrument_count = 2;
  scene.instruments = {"guidewire", "catheter"};
  scene.max_length_mm = {300, 200};
  scene.inserted_at_start_mm = {100, 50};
  torquer_lcm::wire_state_t state{};
  state.instrument_count = 2;
  state.instruments.resize(2);
  state.instruments[0].inserted_at_start_mm = 100;
  state.instruments[0].commanded_insertion_mm = 100;
  state.instruments[1].inserted_at_start_mm = 50;
  state.instruments[1].commanded_insertion_mm = 50;
  steering.Add(scene);
  steering.Add(state);
  CHECK(steering.Commands(kStart + 500'000)[0].insertion_mm == 0);
}
