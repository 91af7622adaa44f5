#include "host/daemon/hand_tracker.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "protocol/lcm_channels.h"

namespace {

using namespace torquer::protocol;
using torquer::calibration::Calibration;
using torquer::daemon::HandState;
using torquer::daemon::HandTracker;
using torquer::daemon::Pose;
using torquer::device::EpochStart;
using torquer::device::Sample;

// 0.01 mm per axial count, 0.002 rad per transverse count, full rate 0.4 rad/s.
Calibration Simple() {
  Calibration calibration;
  calibration.device = "X";
  calibration.motion.cpi = 1200;
  calibration.motion.per_count = {{{0.01, 0.0}, {0.0, 0.002}}};
  for (auto* axis : {&calibration.lao, &calibration.cra}) {
    axis->center = 500.0;
    axis->minimum = 0.0;
    axis->maximum = 1000.0;
    axis->dead_zone = 100.0;
    axis->full_rate_rad_per_s = 0.4;
  }
  return calibration;
}

// Hand with one sample per millisecond.
struct Hand {
  explicit Hand(const std::optional<Calibration>& calibration = Simple(), const Pose& start = {})
      : tracker(calibration, start) {
    sample.surface_quality = 60;
    sample.cpi = 1200;
    sample.joystick_x = 500;
    sample.joystick_y = 500;
    sample.epoch_start = EpochStart::kConnected;
  }
  HandState Step(std::int64_t axial = 0, std::int64_t transverse = 0) {
    sample.axial_counts += axial;
    sample.transverse_counts += transverse;
    const HandState state = tracker.Step(sample);
    sample.epoch_start = EpochStart::kNone;
    sample.device_time_us += 1000;
    return state;
  }
  HandTracker tracker;
  Sample sample;
};

}  // namespace

TEST_CASE("Counts become mm and rad from the first sample on") {
  Hand hand(Simple(), {10.0, 1.0, 0.1, 0.2});
  hand.sample.axial_counts = 123456;
  HandState state = hand.Step();
  CHECK(state.pose.insertion_mm == 10.0);
  CHECK(state.pose.rotation_rad == 1.0);
  CHECK(state.pose.lao_rad == 0.1);
  CHECK(state.pose.cra_rad == 0.2);
  CHECK(state.flags == 0);
  state = hand.Step(100, -50);
  CHECK(state.pose.insertion_mm == Approx(11.0));
  CHECK(state.pose.rotation_rad == Approx(0.9));
  CHECK(hand.tracker.counters().axial_applied == 100);
  CHECK(hand.tracker.counters().transverse_applied == -50);
}

TEST_CASE("With the clutch held the hand moves back and the wire stays") {
  Hand hand;
  hand.Step();
  hand.Step(1000, 10);
  hand.sample.buttons = torquer::protocol::kButtonClutch;
  for (int i = 0; i < 9; ++i) {
    const HandState state = hand.Step(-100, 5);
    CHECK(state.pose.insertion_mm == Approx(10.0));
    CHECK(state.pose.rotation_rad == Approx(0.02));
    CHECK(state.flags == kCommandClutch);
  }
  hand.sample.buttons = 0;
  HandState state = hand.Step(-100, 5);  // begun with the clutch held
  CHECK(state.flags == 0);
  CHECK(state.pose.insertion_mm == Approx(10.0));
  state = hand.Step(300);
  CHECK(state.pose.insertion_mm == Approx(13.0));
  CHECK(hand.tracker.counters().axial_applied == 1300);
  CHECK(hand.tracker.counters().axial_held == -1000);
  CHECK(hand.tracker.counters().transverse_held == 50);
}

TEST_CASE("Motion in doubt is held and flagged until it has passed") {
  const int doubt = GENERATE(0, 1, 2, 3);
  Hand hand;
  hand.Step();
  hand.Step(1000);
  std::int32_t expected = kCommandLift;
  if (doubt == 0) hand.sample.flags = torquer::protocol::kFlagLift;
  if (doubt == 1) hand.sample.surface_quality = 9;
  if (doubt == 2) {
    hand.sample.flags = torquer::protocol::kFlagSensorFault;
    expected = kCommandSensorFault;
  }
  if (doubt == 3) {
    hand.sample.cpi = 800;  // the calibration is for 1200
    expected = kCommandSensorFault;
  }
  for (int i = 0; i < 5; ++i) {
    const HandState state = hand.Step(333, 44);
    CHECK(state.pose.insertion_mm == Approx(10.0));
    CHECK(state.pose.rotation_rad == 0.0);
    CHECK(state.flags == expected);
  }
  hand.sample.flags = 0;
  hand.sample.surface_quality = 60;
  hand.sample.cpi = 1200;
  HandState state = hand.Step(333, 44);  // landing: begun in doubt
  CHECK(state.flags == 0);
  CHECK(state.pose.insertion_mm == Approx(10.0));
  state = hand.Step(100, 10);
  CHECK(state.pose.insertion_mm == Approx(11.0));
  CHECK(state.pose.rotation_rad == Approx(0.02));
}

TEST_CASE("A surface on the edge of poor does not flicker") {
  Hand hand;
  hand.Step();
  hand.sample.surface_quality = 10;
  CHECK(hand.Step().flags == 0);
  hand.sample.surface_quality = 9;
  CHECK(hand.Step().flags == kCommandLift);
  hand.sample.surface_quality = 15;
  CHECK(hand.Step().flags == kCommandLift);
  hand.sample.surface_quality = 16;
  CHECK(hand.Step().flags == 0);
}

TEST_CASE("A new epoch neither moves the wire nor turns the arm") {
  Hand hand;
  hand.Step();
  hand.Step(1000);
  hand.sample.epoch_start = EpochStart::kConnected;
  hand.sample.joystick_x = 1000;
  hand.sample.device_time_us += 5000000;
  const HandState state = hand.Step(0, 0);
  CHECK(state.pose.insertion_mm == Approx(10.0));
  CHECK(state.pose.lao_rad == 0.0);
}

TEST_CASE("The joystick turns the C-arm by device time, within its travel") {
  Hand hand;
  hand.Step();
  hand.sample.joystick_x = 1000;  // full
  hand.sample.joystick_y = 250;   // 150 of 400 beyond the dead zone, negative
  HandState state;
  for (int i = 0; i < 1000; ++i) state = hand.Step();
  CHECK(state.pose.lao_rad == Approx(0.4));
  CHECK(state.pose.cra_rad == Approx(-0.4 * 150.0 / 400.0));
  // After lost reports, the last joystick value holds for at most 50 ms.
  hand.sample.device_time_us += 9999000;
  const double before_rad = state.pose.lao_rad;
  state = hand.Step();
  CHECK(state.pose.lao_rad - before_rad == Approx(0.4 * 0.05));
  for (int i = 0; i < 20000; ++i) state = hand.Step();
  CHECK(state.pose.lao_rad == torquer::daemon::kLaoLimitRad);
  CHECK(state.pose.cra_rad == -torquer::daemon::kCraLimitRad);
  hand.sample.joystick_x = 600;  // in the dead zone
  hand.sample.joystick_y = 400;
  CHECK(hand.Step().pose.lao_rad == torquer::daemon::kLaoLimitRad);
}

TEST_CASE("Each press of the stick's button gives the joystick to the next: table, height, C-arm") {
  Hand hand;
  hand.Step();
  const auto press = [&] {
    hand.sample.buttons = torquer::protocol::kButtonStick;
    hand.Step();
    const HandState held = hand.Step();  // a held button is one press
    hand.sample.buttons = 0;
    hand.Step();
    return held.flags;
  };
  const auto hold_for_1_s = [&](std::uint16_t x, std::uint16_t y) {
    hand.sample.joystick_x = x;
    hand.sample.joystick_y = y;
    HandState state;
    for (int i = 0; i < 1000; ++i) state = hand.Step();
    hand.sample.joystick_x = hand.sample.joystick_y = 500;
    hand.Step();
    return state.pose;
  };
  CHECK(press() == kCommandStickTable);
  // Full deflection is 0.4 rad/s of the C-arm: 64 mm/s to the left and towards the feet.
  Pose pose = hold_for_1_s(1000, 0);
  CHECK(pose.table.left_mm == Approx(64));
  CHECK(pose.table.head_mm == Approx(-64));
  CHECK(pose.table.height_mm == 0);
  CHECK(pose.lao_rad == 0);
  CHECK(pose.cra_rad == 0);

  CHECK(press() == kCommandStickHeight);
  pose = hold_for_1_s(1000, 1000);
  CHECK(pose.table.left_mm == Approx(64));
  CHECK(pose.table.head_mm == Approx(-64));
  CHECK(pose.table.height_mm == Approx(32));
  for (int i = 0; i < 5; ++i) pose = hold_for_1_s(500, 1000);
  CHECK(pose.table.height_mm == 150);

  CHECK(press() == 0);
  pose = hold_for_1_s(1000, 500);
  CHECK(pose.lao_rad == Approx(0.4));
  CHECK(pose.table.left_mm == Approx(64));
  // Without a device the table stays; a new start puts it back.
  CHECK(hand.tracker.Hold().pose.table.height_mm == 150);
  hand.tracker.Home();
  CHECK(hand.Step().pose.table == torquer::daemon::TablePlace{});
}

TEST_CASE("Pedals are passed on, and are up without a device") {
  Hand hand;
  hand.sample.buttons = torquer::protocol::kButtonXray;
  HandState state = hand.Step();
  CHECK(state.xray);
  CHECK_FALSE(state.contrast);
  hand.sample.buttons = torquer::protocol::kButtonContrast;
  state = hand.Step(700);
  CHECK_FALSE(state.xray);
  CHECK(state.contrast);
  state = hand.tracker.Hold();
  CHECK_FALSE(state.contrast);
  CHECK(state.flags == kCommandNoDevice);
  CHECK(state.pose.insertion_mm == Approx(7.0));
}

TEST_CASE("Home makes the present place the start") {
  Hand hand;
  hand.Step();
  hand.sample.joystick_x = 1000;
  hand.Step(1000, 100);
  hand.sample.joystick_x = 500;
  hand.tracker.Home();
  HandState state = hand.Step();
  CHECK(state.pose.insertion_mm == 0.0);
  CHECK(state.pose.rotation_rad == 0.0);
  CHECK(state.pose.lao_rad == 0.0);
  state = hand.Step(100);
  CHECK(state.pose.insertion_mm == Approx(1.0));
  CHECK(hand.tracker.counters().axial_applied == 1100);
}

TEST_CASE("Without a calibration the gains follow the sensor's resolution, which is reported") {
  Hand hand(std::nullopt);
  hand.Step();
  HandState state = hand.Step(1200);
  CHECK(state.pose.insertion_mm == Approx(25.4));
  CHECK(state.flags == kCommandUncalibrated);
  CHECK(hand.tracker.Hold().flags == (kCommandNoDevice | kCommandUncalibrated));
  hand.sample.cpi = 2400;
  hand.Step();
  state = hand.Step(2400);
  CHECK(state.pose.insertion_mm == Approx(50.8));
  CHECK(state.flags == kCommandUncalibrated);
}

namespace {

// Closes the switch at the place of `hand`; it opens again in the next step.
HandState CloseSwitch(Hand& hand) {
  hand.sample.flags |= kFlagReference | kFlagAtReference;
  hand.sample.reference_counts = hand.sample.axial_counts;
  const HandState state = hand.Step();
  hand.sample.flags &= ~kFlagAtReference;
  return state;
}

HandState Rest(Hand& hand, int samples) {
  HandState state;
  for (int i = 0; i < samples; ++i) state = hand.Step();
  return state;
}

}  // namespace

TEST_CASE("Motion lost between two closings of the end switch is corrected without a jump") {
  Hand hand;
  hand.Step();
  HandState state = CloseSwitch(hand);
  REQUIRE(state.mark);
  CHECK(state.mark->first);
  hand.Step(5000);  // 50 mm
  double expected_mm = 50.0;
  double lost_mm = 0.0;
  SECTION("no loss") {
    hand.Step(-5000);
    expected_mm = 0.0;
  }
  SECTION("less than the switch is repeatable by") {
    hand.Step(-4975);
    expected_mm = 0.25;
  }
  SECTION("pushing that the sensor did not see") {
    hand.Step(-6000);  // so 10 mm more were pushed
    expected_mm = 0.0;
    lost_mm = 10.0;
  }
  SECTION("pulling back that was in doubt, and therefore dropped") {
    hand.sample.flags |= kFlagLift;
    hand.Step(-1000);
    hand.Step(-1000);
    hand.sample.flags &= ~kFlagLift;
    hand.Step();
    hand.Step(-3000);
    expected_mm = 0.0;
    lost_mm = -20.0;
  }
  SECTION("the clutch was held for a part of the way: the wire must stay") {
    hand.sample.buttons = kButtonClutch;
    hand.Step(-2000);
    hand.sample.buttons = 0;
    hand.Step();
    hand.Step(-3000);
    expected_mm = 20.0;
  }
  SECTION("the device was reset on the way") {
    hand.sample.flags = 0;
    hand.sample.reference_counts = 0;
    hand.sample.epoch_start = EpochStart::kReset;
    hand.Step();
    hand.Step(-3000);  // 20 mm were lost
    expected_mm = 0.0;
    lost_mm = -20.0;
  }
  const double before_mm = hand.Step().pose.insertion_mm;
  state = CloseSwitch(hand);
  REQUIRE(state.mark);
  CHECK_FALSE(state.mark->first);
  CHECK_FALSE(state.mark->refused);
  CHECK(state.mark->lost_mm == Approx(lost_mm));
  double last_mm = state.pose.insertion_mm;
  CHECK(std::abs(last_mm - before_mm) < 0.0201);
  for (int i = 0; i < 2000; ++i) {
    const double now_mm = hand.Step().pose.insertion_mm;
    REQUIRE(std::abs(now_mm - last_mm) < 0.0201);
    last_mm = now_mm;
  }
  CHECK(last_mm == Approx(expected_mm).margin(1e-9));
  CHECK(hand.tracker.counters().healed_um == std::llround(1000 * lost_mm));
  // The loss has been made up: the next mark shows none.
  state = CloseSwitch(hand);
  REQUIRE(state.mark);
  CHECK(state.mark->lost_mm == 0.0);
}

TEST_CASE("The touch counts, not the report that brings it; a mark is passed once") {
  Hand hand;
  hand.Step();
  CloseSwitch(hand);
  hand.Step(2000);
  hand.Step(-2000);
  hand.sample.flags |= kFlagAtReference;
  hand.sample.reference_counts = hand.sample.axial_counts;
  // By the time of the debounced report the cylinder is 0.5 mm farther.
  HandState state = hand.Step(-50);
  REQUIRE(state.mark);
  CHECK(state.mark->lost_mm == 0.0);
  for (int i = 0; i < 5; ++i) CHECK_FALSE(hand.Step(-10).mark);
  hand.sample.flags &= ~kFlagAtReference;
  CHECK_FALSE(hand.Step(100).mark);
  CHECK(hand.tracker.counters().marks_passed == 2);
}

TEST_CASE("Making up for a loss waits while the wire is held, and ends with a new start") {
  Hand hand;
  hand.Step();
  CloseSwitch(hand);
  CloseSwitch(hand);
  hand.Step(1000);
  hand.Step(-3000);
  const double before_mm = hand.sample.axial_counts * 0.01;
  hand.sample.buttons = kButtonClutch;
  CHECK(CloseSwitch(hand).mark->lost_mm == Approx(20.0));
  CHECK(Rest(hand, 500).pose.insertion_mm == Approx(before_mm));
  hand.sample.buttons = 0;
  CHECK(Rest(hand, 500).pose.insertion_mm == Approx(before_mm + 10.0));
  hand.tracker.Home();
  CHECK(Rest(hand, 500).pose.insertion_mm == 0.0);
}

TEST_CASE("A mark farther away than the device is long is not believed") {
  Hand hand;
  hand.Step();
  CloseSwitch(hand);
  hand.Step(16000);
  HandState state = CloseSwitch(hand);
  REQUIRE(state.mark);
  CHECK(state.mark->refused);
  CHECK(Rest(hand, 100).pose.insertion_mm == Approx(160.0));
  // From here on the refused place is the reference; another device has another one.
  CHECK(CloseSwitch(hand).mark->lost_mm == 0.0);
  hand.tracker.ForgetMark();
  hand.Step(1000);
  CHECK(CloseSwitch(hand).mark->first);
}
