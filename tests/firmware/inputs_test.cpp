#include <catch2/catch.hpp>

#include "firmware/src/buttons.h"
#include "firmware/src/joystick.h"
#include "protocol/hid_reports.h"
#include "tests/firmware/fake_board.h"

namespace torquer::firmware {
namespace {

TEST_CASE("a button counts after five equal readings, pressed or released") {
  Buttons buttons;
  for (int i = 0; i < 4; ++i) CHECK(buttons.Update(protocol::kButtonXray) == 0);
  CHECK(buttons.Update(protocol::kButtonXray) == protocol::kButtonXray);
  for (int i = 0; i < 4; ++i) CHECK(buttons.Update(0) == protocol::kButtonXray);
  CHECK(buttons.Update(0) == 0);
}

TEST_CASE("bounces begin the count anew") {
  Buttons buttons;
  for (int i = 0; i < 50; ++i) {
    CHECK(buttons.Update(i % 5 == 4 ? 0 : protocol::kButtonClutch) == 0);
  }
}

TEST_CASE("buttons are debounced each for itself") {
  Buttons buttons;
  for (int i = 0; i < 3; ++i) buttons.Update(protocol::kButtonXray);
  for (int i = 0; i < 2; ++i) buttons.Update(protocol::kButtonXray | protocol::kButtonContrast);
  CHECK(buttons.Update(protocol::kButtonXray | protocol::kButtonContrast) == protocol::kButtonXray);
  buttons.Update(protocol::kButtonXray | protocol::kButtonContrast);
  CHECK(buttons.Update(protocol::kButtonXray | protocol::kButtonContrast) ==
        (protocol::kButtonXray | protocol::kButtonContrast));
}

TEST_CASE("the dead zone is reported as the middle, its edge included, the rest untouched") {
  CHECK(ApplyDeadzone(512, 0) == 512);
  CHECK(ApplyDeadzone(513, 0) == 513);
  CHECK(ApplyDeadzone(522, 10) == 512);
  CHECK(ApplyDeadzone(523, 10) == 523);
  CHECK(ApplyDeadzone(502, 10) == 512);
  CHECK(ApplyDeadzone(501, 10) == 501);
  CHECK(ApplyDeadzone(0, 511) == 0);
  CHECK(ApplyDeadzone(1, 511) == 512);
  CHECK(ApplyDeadzone(1023, 511) == 512);
}

TEST_CASE("each axis is read from its own channel") {
  NewBoard().joystick = {100, 900};
  Joystick joystick;
  joystick.Start();
  joystick.BeginFrame();
  joystick.EndFrame();
  CHECK(joystick.x(0) == 100);
  CHECK(joystick.y(0) == 900);
}

}  // namespace
}  // namespace torquer::firmware
