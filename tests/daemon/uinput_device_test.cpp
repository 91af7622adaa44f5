#include "host/daemon/uinput_device.h"

#include <linux/input.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <random>

#include "protocol/lcm_channels.h"

namespace torquer::daemon {
namespace {

using Events = std::vector<BoxEvent>;

HandState At(double insertion_mm, double rotation_rad) {
  HandState hand;
  hand.pose.insertion_mm = insertion_mm;
  hand.pose.rotation_rad = rotation_rad;
  return hand;
}

TEST_CASE("The first state sets the stick without motion; a repeated one sends no event") {
  BoxEvents events;
  CHECK(events.Of(At(123, 4)) ==
        Events{{EV_ABS, ABS_X, 512}, {EV_ABS, ABS_Y, 512}, {EV_SYN, SYN_REPORT, 0}});
  CHECK(events.Of(At(123, 4)).empty());
}

TEST_CASE("Motion, stick and buttons become events, each when it changes") {
  BoxEvents events;
  events.Of(At(0, 0));
  CHECK(events.Of(At(0.5, -0.25)) ==
        Events{{EV_REL, REL_Z, 50}, {EV_REL, REL_RZ, -250}, {EV_SYN, SYN_REPORT, 0}});
  HandState hand = At(0.5, -0.25);
  hand.joystick_x = 1023;
  hand.joystick_y = 3;
  hand.xray = hand.contrast = true;
  hand.flags = protocol::kCommandClutch | protocol::kCommandUncalibrated;
  CHECK(events.Of(hand) == Events{{EV_ABS, ABS_X, 1023},
                                  {EV_ABS, ABS_Y, 3},
                                  {EV_KEY, BTN_TRIGGER, 1},
                                  {EV_KEY, BTN_THUMB, 1},
                                  {EV_KEY, BTN_THUMB2, 1},
                                  {EV_SYN, SYN_REPORT, 0}});
  // Once the device is gone, no button stays pressed.
  HandTracker tracker(std::nullopt, {0.5, -0.25, 0, 0});
  CHECK(events.Of(tracker.Hold()) == Events{{EV_ABS, ABS_X, 512},
                                            {EV_ABS, ABS_Y, 512},
                                            {EV_KEY, BTN_TRIGGER, 0},
                                            {EV_KEY, BTN_THUMB, 0},
                                            {EV_KEY, BTN_THUMB2, 0},
                                            {EV_SYN, SYN_REPORT, 0}});
}

TEST_CASE("A new start of the instrument sends no motion of the hand") {
  HandTracker tracker(std::nullopt, {80, 3, 0, 0});
  BoxEvents events;
  events.Of(tracker.Hold());
  tracker.Home();
  const HandState home = tracker.Hold();
  CHECK(home.pose.insertion_mm == 0);
  CHECK(events.Of(home).empty());
}

TEST_CASE("Steps smaller than a unit add up to the whole") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> step(-0.004, 0.005);
  BoxEvents events;
  double insertion_mm = 0.0;
  double rotation_rad = 0.0;
  std::int64_t pushed = 0;
  std::int64_t turned = 0;
  events.Of(At(0, 0));
  for (int i = 0; i < 20000; ++i) {
    insertion_mm += step(random);
    rotation_rad -= 0.1 * step(random);
    for (const BoxEvent& event : events.Of(At(insertion_mm, rotation_rad))) {
      if (event.type != EV_REL) continue;
      (event.code == REL_Z ? pushed : turned) += event.value;
    }
  }
  CHECK(std::abs(static_cast<double>(pushed) - 100 * insertion_mm) <= 0.5);
  CHECK(std::abs(static_cast<double>(turned) - 1000 * rotation_rad) <= 0.5);
}

}  // namespace
}  // namespace torquer::daemon
