#include <catch2/catch.hpp>
#include <cstdlib>

#include "firmware/src/buttons.h"
#include "firmware/src/joystick.h"
#include "firmware/src/reference_switch.h"
#include "protocol/hid_reports.h"
#include "tests/firmware/fake_board.h"

namespace torquer::firmware {
namespace {

constexpr int kStable = Buttons::kStableReadings;

TEST_CASE("a button counts after ten equal readings, pressed or released") {
  REQUIRE(kStable == 10);
  Buttons buttons;
  for (int i = 0; i < 9; ++i) CHECK(buttons.Update(protocol::kButtonXray) == 0);
  CHECK(buttons.Update(protocol::kButtonXray) == protocol::kButtonXray);
  for (int i = 0; i < 9; ++i) CHECK(buttons.Update(0) == protocol::kButtonXray);
  CHECK(buttons.Update(0) == 0);
}

TEST_CASE("bounces begin the count from the start") {
  Buttons buttons;
  for (int i = 0; i < 100; ++i) {
    CHECK(buttons.Update(i % 10 == 9 ? 0 : protocol::kButtonClutch) == 0);
  }
}

TEST_CASE("readings that are far apart need to agree twice alone") {
  Buttons buttons;
  CHECK(buttons.Update(protocol::kButtonClutch, Buttons::kStableReadingsSuspended) == 0);
  CHECK(buttons.Update(protocol::kButtonClutch, Buttons::kStableReadingsSuspended) ==
        protocol::kButtonClutch);
}

TEST_CASE("buttons are debounced each for itself") {
  Buttons buttons;
  constexpr std::uint8_t kBoth = protocol::kButtonXray | protocol::kButtonContrast;
  for (int i = 0; i < 7; ++i) buttons.Update(protocol::kButtonXray);
  for (int i = 0; i < 2; ++i) CHECK(buttons.Update(kBoth) == 0);
  CHECK(buttons.Update(kBoth) == protocol::kButtonXray);
  for (int i = 0; i < 6; ++i) CHECK(buttons.Update(kBoth) == protocol::kButtonXray);
  CHECK(buttons.Update(kBoth) == kBoth);
}

/// Axis with enough readings to know its rest position.
JoystickAxis Measured(int rest, int noise = 0) {
  JoystickAxis axis(0);
  for (int i = 0; i < 100; ++i) axis.Take(static_cast<std::uint16_t>(rest + (i % 2) * noise));
  return axis;
}
int Reported(JoystickAxis axis, int value, int deadzone = 0) {
  axis.Take(static_cast<std::uint16_t>(value));
  return axis.Report(static_cast<std::uint16_t>(deadzone));
}

TEST_CASE("the dead zone is reported as the middle, its edge included") {
  const JoystickAxis axis = Measured(512);
  CHECK(axis.rest() == 512);
  CHECK(Reported(axis, 512) == 512);
  CHECK(Reported(axis, 513) == 513);
  CHECK(Reported(axis, 522, 10) == 512);
  CHECK(Reported(axis, 523, 10) == 523);
  CHECK(Reported(axis, 502, 10) == 512);
  CHECK(Reported(axis, 501, 10) == 501);
  CHECK(Reported(axis, 0, 511) == 0);
  CHECK(Reported(axis, 1, 511) == 512);
  CHECK(Reported(axis, 1023, 511) == 512);
}

TEST_CASE("wherever a stick rests, that is the middle, and its ends are the ends") {
  for (int rest = 512 - 120; rest <= 512 + 117; rest += 3) {
    CAPTURE(rest);
    const JoystickAxis axis = Measured(rest, 3);
    CHECK(std::abs(axis.rest() - rest) <= 2);
    CHECK(Reported(axis, rest, 20) == 512);
    CHECK(Reported(axis, 0, 20) == 0);
    CHECK(Reported(axis, 1023, 20) == 1023);
    // Between the ends it increases in steps of at most two and stays in range.
    int before = Reported(axis, 0);
    for (int value = 1; value <= 1023; ++value) {
      const int reported = Reported(axis, value);
      REQUIRE(reported >= before);
      REQUIRE(reported <= before + 2);
      before = reported;
    }
  }
}

TEST_CASE(
    "a stick that is held or moved at the start, or rests beyond belief, has its middle at 512") {
  CHECK(Measured(512 + 121).rest() == 512);
  CHECK(Measured(512 - 121).rest() == 512);
  CHECK(Measured(1023).rest() == 512);
  CHECK(Measured(0).rest() == 512);
  CHECK(Measured(500, 17).rest() == 512);
  CHECK(Measured(500, 16).rest() != 512);
  CHECK(Reported(Measured(1023), 700) == 700);
  // Readings before the measuring window have no effect.
  JoystickAxis axis(0);
  for (int i = 0; i < 30; ++i) axis.Take(1023);
  for (int i = 0; i < 70; ++i) axis.Take(540);
  CHECK(axis.rest() == 540);
  // Readings after the window do not change the rest position.
  for (int i = 0; i < 500; ++i) axis.Take(600);
  CHECK(axis.rest() == 540);
}

TEST_CASE("each axis is read from its own channel") {
  NewBoard().analog = {100, 900, 225};
  Joystick joystick;
  joystick.Start();
  joystick.BeginFrame();
  joystick.EndFrame();
  CHECK(joystick.x().Report(0) == 100);
  CHECK(joystick.y().Report(0) == 900);
  CHECK(joystick.supply_mv() == 0);
  for (int frame = 0; frame < 300; ++frame) {
    joystick.BeginFrame();
    joystick.EndFrame();
    REQUIRE(joystick.x().Report(0) == 100);
    REQUIRE(joystick.y().Report(0) == 900);
  }
  CHECK(joystick.supply_mv() == 5000);  // 1.1 V reads as 225 of 1024
}

/// End switch with one frame per millisecond: a cylinder count and a contact state, debounced as in
/// the device.
class EndSwitch {
 public:
  void Frame(bool contact, std::int32_t counts) {
    const std::uint8_t held = buttons_.Update(contact ? 8 : 0);
    reference.Update(contact, (held & 8) != 0, counts);
  }
  void Frames(int frames, bool contact, std::int32_t counts) {
    for (int i = 0; i < frames; ++i) Frame(contact, counts);
  }
  ReferenceSwitch reference;

 private:
  Buttons buttons_;
};

TEST_CASE("the end switch marks the count of the first touch, bounces or not") {
  EndSwitch end;
  for (int count = 200; count > 100; --count) end.Frame(false, count);
  CHECK_FALSE(end.reference.passed());
  // The contact closes at 100, but its debounced state is closed only at 70.
  for (int count = 100; count > 80; --count) end.Frame(count % 3 != 0 || count == 100, count);
  CHECK_FALSE(end.reference.passed());
  end.Frames(12, true, 70);
  CHECK(end.reference.passed());
  CHECK(end.reference.closed());
  CHECK(end.reference.counts() == 100);
  // Opens and closes again.
  end.Frames(50, false, 90);
  CHECK_FALSE(end.reference.closed());
  CHECK(end.reference.passed());
  CHECK(end.reference.counts() == 100);
  end.Frames(15, true, 96);
  CHECK(end.reference.counts() == 96);
}

TEST_CASE("a spark does not count as a touch, and a switch closed at the start has no position") {
  EndSwitch end;
  end.Frames(30, false, 10);
  end.Frames(3, true, 11);
  end.Frames(30, false, 12);
  CHECK_FALSE(end.reference.passed());
  end.Frames(15, true, 40);
  CHECK(end.reference.counts() == 40);

  EndSwitch closed;
  closed.Frames(50, true, 7);
  CHECK(closed.reference.closed());
  CHECK_FALSE(closed.reference.passed());
  CHECK(closed.reference.counts() == 0);
  closed.Frames(50, false, 20);
  closed.Frames(15, true, 19);
  CHECK(closed.reference.counts() == 19);
}

TEST_CASE("zeroing the count moves the mark with it") {
  EndSwitch end;
  end.Frames(30, false, 500);
  end.Frames(15, true, 400);
  end.reference.Shift(420);
  CHECK(end.reference.counts() == -20);
  EndSwitch never;
  never.reference.Shift(420);
  CHECK(never.reference.counts() == 0);
}

}  // namespace
}  // namespace torquer::firmware
