// Emulated parts compared with their data sheets: they must detect misuse that real parts punish.
#include <catch2/catch.hpp>
#include <fstream>

#include "host/emulator/motion_script.h"
#include "host/emulator/usb_controller.h"
#include "host/support/error.h"
#include "protocol/hid_reports.h"
#include "tests/emulator/sensor_speaker.h"
#include "tests/support/temporary_folder.h"

namespace torquer::emulator {
namespace {

void Converse(SensorSpeaker* speaker) {
  CHECK(speaker->Read(0x00) == 0x42);
  speaker->Write(0x0f, 11);
  speaker->Write(0x50, 0);
  speaker->Burst();
  speaker->Burst();
  CHECK(speaker->Read(0x0f) == 11);
  CHECK(speaker->Read(0x3f) == 0xbd);
}

TEST_CASE("a conversation at exactly the data sheet's times passes") {
  SensorSpeaker speaker;
  Converse(&speaker);
  CHECK(speaker.sensor.violation_count() == 0);
  CHECK(speaker.Violation().empty());
}

TEST_CASE("each time that falls short is named") {
  const std::pair<double SensorSpeaker::*, const char*> cases[] = {
      {&SensorSpeaker::select_to_clock_us, "tNCS-SCLK"},
      {&SensorSpeaker::address_to_data_us, "tSRAD"},
      {&SensorSpeaker::write_to_deselect_us, "tSCLK-NCS (write)"},
      {&SensorSpeaker::after_read_us, "tSRW"},
      {&SensorSpeaker::after_write_us, "tSWW"},
      {&SensorSpeaker::address_to_burst_us, "tSRAD_MOTBR"},
      {&SensorSpeaker::burst_exit_us, "tBEXIT"},
  };
  for (const auto& [time, name] : cases) {
    SensorSpeaker speaker;
    speaker.*time *= 0.4;
    if (time != &SensorSpeaker::write_to_deselect_us) {
      Converse(&speaker);
    } else {
      speaker.Write(0x0f, 11);
    }
    INFO(name);
    CHECK(speaker.sensor.violation_count() > 0);
    CHECK_THAT(speaker.Violation(), Catch::Contains(name));
  }
}

TEST_CASE("a clock too fast, another mode, and an access too early are named") {
  SensorSpeaker fast;
  fast.clock_hz = 4e6;
  fast.Read(0x00);
  CHECK_THAT(fast.Violation(), Catch::Contains("above 2 MHz"));
  SensorSpeaker mode;
  mode.mode = 0;
  mode.Read(0x00);
  CHECK_THAT(mode.Violation(), Catch::Contains("SPI mode"));
  SensorSpeaker early;
  early.Write(0x3a, 0x5a);
  early.Read(0x00);
  CHECK_THAT(early.Violation(), Catch::Contains("50 ms"));
  SensorSpeaker unarmed;
  unarmed.Burst();
  CHECK_THAT(unarmed.Violation(), Catch::Contains("arms it"));
  SensorSpeaker disarmed;
  disarmed.Write(0x50, 0);
  disarmed.Burst();
  disarmed.Read(0x00);
  disarmed.Burst();
  CHECK_THAT(disarmed.Violation(), Catch::Contains("arms it"));
}

class Controller {
 public:
  // Register addresses from the data sheet.
  static constexpr int kUsbcon = 0xd8, kUdcon = 0xe0, kUdint = 0xe1, kUdien = 0xe2, kUdaddr = 0xe3,
                       kUeintx = 0xe8, kUenum = 0xe9, kUeconx = 0xeb, kUecfg0x = 0xec,
                       kUecfg1x = 0xed, kUesta0x = 0xee, kUeienx = 0xf0, kUedatx = 0xf1;

  Controller() {
    usb.SetPllLocked(true);
    Set(kUsbcon, 0x90);
    Set(kUdcon, 0);
    Set(kUenum, 0);
    Set(kUeconx, 1);
    Set(kUecfg0x, 0);
    Set(kUecfg1x, 0x22);
    Set(kUenum, 1);
    Set(kUeconx, 1);
    Set(kUecfg0x, 0xc1);
    Set(kUecfg1x, 0x26);
  }
  void Set(int address, int value) {
    usb.Write(static_cast<std::uint16_t>(address), static_cast<std::uint8_t>(value));
  }
  int Get(int address) { return usb.Read(static_cast<std::uint16_t>(address)); }
  void Send(int value) {
    Set(kUeintx, 0xff & ~0x05);
    Set(kUedatx, value);
    Set(kUeintx, 0xff & ~0x84);
  }
  int TakeIn() {
    std::vector<std::uint8_t> packet;
    return usb.In(0, 1, &packet, &toggle) == UsbAnswer::kAck ? packet.at(0) : -1;
  }

  UsbController usb;
  bool toggle = false;
};

TEST_CASE("the input endpoint has two banks, first in, first out, toggles alternating") {
  Controller controller;
  CHECK(controller.TakeIn() == -1);
  controller.Send(1);
  CHECK((controller.Get(Controller::kUesta0x) & 3) == 1);
  CHECK((controller.Get(Controller::kUeintx) & 1) != 0);
  controller.Send(2);
  CHECK((controller.Get(Controller::kUesta0x) & 3) == 2);
  CHECK((controller.Get(Controller::kUeintx) & 0xa1) == 0);  // no bank: no TXINI, RWAL, FIFOCON
  CHECK(controller.TakeIn() == 1);
  CHECK_FALSE(controller.toggle);
  CHECK((controller.Get(Controller::kUeintx) & 0x81) == 0x81);
  CHECK(controller.TakeIn() == 2);
  CHECK(controller.toggle);
  CHECK(controller.usb.violations().empty());
}

TEST_CASE("writing without a bank is noticed") {
  Controller controller;
  controller.Send(1);
  controller.Send(2);
  controller.Send(3);
  REQUIRE_FALSE(controller.usb.violations().empty());
  CHECK_THAT(controller.usb.violations().front(), Catch::Contains("UEDATX"));
}

TEST_CASE("a one in the kill bit drops the packet written last, as on silicon") {
  Controller controller;
  controller.Send(1);
  controller.Send(2);
  controller.Set(Controller::kUeintx, 0xff);
  CHECK((controller.Get(Controller::kUesta0x) & 3) == 1);
  CHECK(controller.TakeIn() == 1);
  CHECK(controller.TakeIn() == -1);
  CHECK(controller.usb.violations().empty());
  controller.Set(Controller::kUeintx, 0xff & ~0x01);  // clears TXINI only: the kill bit is 1
  REQUIRE_FALSE(controller.usb.violations().empty());
  CHECK_THAT(controller.usb.violations().front(), Catch::Contains("KILLBK"));
}

TEST_CASE("interrupt requests are levels") {
  Controller controller;
  controller.Set(Controller::kUdien, 0x04);
  CHECK_FALSE(controller.usb.general_interrupt());
  controller.usb.StartOfFrame(1);
  CHECK(controller.usb.general_interrupt());
  controller.Set(Controller::kUdint, 0xff);  // writing ones does not clear bits
  CHECK(controller.usb.general_interrupt());
  controller.Set(Controller::kUdint, 0x00);
  CHECK_FALSE(controller.usb.general_interrupt());

  controller.Set(Controller::kUenum, 0);
  controller.Set(Controller::kUeienx, 0x08);
  const std::uint8_t setup[8] = {0x80, 6, 0, 1, 0, 0, 8, 0};
  REQUIRE(controller.usb.Setup(0, setup) == UsbAnswer::kAck);
  CHECK(controller.usb.endpoint_interrupt());
  std::vector<std::uint8_t> packet;
  CHECK(controller.usb.In(0, 0, &packet) == UsbAnswer::kNak);
  controller.Set(Controller::kUeintx, 0xff & ~0x08);
  CHECK_FALSE(controller.usb.endpoint_interrupt());
}

TEST_CASE("the device answers to its own address alone, and only once it is enabled") {
  Controller controller;
  controller.Send(1);
  controller.Set(Controller::kUdaddr, 5);
  std::vector<std::uint8_t> packet;
  CHECK(controller.usb.In(5, 1, &packet) == UsbAnswer::kNone);
  controller.Set(Controller::kUdaddr, 0x85);
  CHECK(controller.usb.In(0, 1, &packet) == UsbAnswer::kNone);
  CHECK(controller.usb.In(5, 1, &packet) == UsbAnswer::kAck);
  controller.Set(Controller::kUdcon, 1);
  CHECK_FALSE(controller.usb.Attached());
  CHECK(controller.usb.In(5, 1, &packet) == UsbAnswer::kNone);
}

TEST_CASE("an address and its enabling in one write are noticed") {
  Controller controller;
  controller.Set(Controller::kUdaddr, 0x85);
  REQUIRE(controller.usb.violations().size() == 1);
  CHECK_THAT(controller.usb.violations().front(), Catch::Contains("ADDEN"));
  Controller orderly;
  orderly.Set(Controller::kUdaddr, 5);
  orderly.Set(Controller::kUdaddr, 0x85);
  CHECK(orderly.usb.violations().empty());
}

TEST_CASE("memory is given out in rising order, to its end, and stays given over a bus reset") {
  Controller controller;  // endpoints 0 and 1 have 32 and 64 bytes
  CHECK((controller.Get(Controller::kUesta0x) & 0x80) != 0);
  SECTION("an endpoint below another that changes its size moves that one's memory") {
    controller.usb.BusReset();
    controller.Set(Controller::kUenum, 0);
    controller.Set(Controller::kUecfg1x, 0x32);  // 64 bytes
    REQUIRE_FALSE(controller.usb.violations().empty());
    CHECK_THAT(controller.usb.violations().front(), Catch::Contains("endpoint 1 above it"));
  }
  SECTION("the same size keeps the memory") {
    controller.usb.BusReset();
    controller.Set(Controller::kUenum, 0);
    controller.Set(Controller::kUecfg1x, 0x22);
    CHECK(controller.usb.violations().empty());
    CHECK((controller.Get(Controller::kUesta0x) & 0x80) != 0);
  }
  SECTION("sizes and banks that there are not, and memory that there is not") {
    controller.Set(Controller::kUenum, 2);
    controller.Set(Controller::kUecfg1x, 0x42);  // 128 bytes, possible for endpoint 1 only
    CHECK((controller.Get(Controller::kUesta0x) & 0x80) == 0);
    controller.Set(Controller::kUecfg1x, 0x3a);  // three banks
    CHECK((controller.Get(Controller::kUesta0x) & 0x80) == 0);
    controller.usb.ExhaustMemory();
    controller.Set(Controller::kUecfg1x, 0x02);
    CHECK((controller.Get(Controller::kUesta0x) & 0x80) == 0);
  }
  SECTION("switched off, the controller forgets it all") {
    controller.Set(Controller::kUsbcon, 0);
    controller.Set(Controller::kUsbcon, 0x90);
    controller.Set(Controller::kUenum, 0);
    controller.Set(Controller::kUecfg1x, 0x32);
    CHECK(controller.usb.violations().empty());
    CHECK(controller.Get(Controller::kUdien) == 0);
    CHECK(controller.Get(Controller::kUdaddr) == 0);
  }
}

TEST_CASE("the cable's voltage requests an interrupt if it was left enabled") {
  Controller controller;
  CHECK_FALSE(controller.usb.general_interrupt());
  controller.Set(Controller::kUsbcon, 0x91);
  CHECK(controller.usb.general_interrupt());
  controller.Set(Controller::kUsbcon, 0x90);
  CHECK_FALSE(controller.usb.general_interrupt());
}

TEST_CASE("a halted endpoint stalls, endpoint 0 until the next SETUP") {
  Controller controller;
  controller.Set(Controller::kUeconx, 0x21);
  std::vector<std::uint8_t> packet;
  CHECK(controller.usb.In(0, 1, &packet) == UsbAnswer::kStall);
  controller.Set(Controller::kUeconx, 0x19);
  CHECK(controller.usb.In(0, 1, &packet) == UsbAnswer::kNak);
  controller.Set(Controller::kUenum, 0);
  controller.Set(Controller::kUeconx, 0x21);
  CHECK(controller.usb.Out(0, 0, {}) == UsbAnswer::kStall);
  const std::uint8_t setup[8] = {};
  CHECK(controller.usb.Setup(0, setup) == UsbAnswer::kAck);
  CHECK(controller.usb.Out(0, 0, {}) == UsbAnswer::kNak);
}

constexpr char kHeader[] = "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons\n";

MotionScript Script(const std::string& text) {
  const test::TemporaryFolder folder;
  const std::string path = folder.Path("motion.csv");
  std::ofstream(path) << text;
  return MotionScript::FromFile(path);
}

TEST_CASE("a motion file is linear between its rows and constant outside of them") {
  const MotionScript script =
      Script(std::string(kHeader) +
             "1,10,0,0,-1,none\n3,20,4,1,0,xray+clutch\n4,20,4,1,0,stick\n5,20,4,1,0,\n");
  CHECK(script.At(0).insertion_mm == 10);
  CHECK(script.At(2).insertion_mm == 15);
  CHECK(script.At(2).rotation_rad == 2);
  CHECK(script.At(2).joystick_x == 0.5);
  CHECK(script.At(2).joystick_y == -0.5);
  CHECK(script.At(2.9).buttons == 0);
  CHECK(script.At(3).buttons == (protocol::kButtonXray | protocol::kButtonClutch));
  CHECK(script.At(4).buttons == protocol::kButtonStick);
  CHECK(script.At(9).insertion_mm == 20);
  CHECK(script.At(9).buttons == 0);
  CHECK(script.duration_s() == 5);
}

TEST_CASE("a bad motion file is refused with line, value and remedy") {
  const std::pair<const char*, const char*> cases[] = {
      {"0,x,0,0,0,\n", "x"},           {"0,0,0,0,0,\n0,1,0,0,0,\n", "later"},
      {"-1,0,0,0,0,\n", "begin at 0"}, {"0,0,0,1.5,0,\n", "-1 to 1"},
      {"0,0,0,0,0,laser\n", "laser"},  {"0,0,nan,0,0,\n", "nan"},
      {"0,0,0,0,0\n", "motion.csv"},   {"", "at least one"},
  };
  for (const auto& [rows, message] : cases) {
    INFO(rows);
    CHECK_THROWS_AS(Script(std::string(kHeader) + rows), UserError);
    CHECK_THROWS_WITH(Script(std::string(kHeader) + rows),
                      Catch::Contains(message) && Catch::Contains("motion.csv"));
  }
  CHECK_THROWS_AS(Script("time,position\n0,0\n"), UserError);
  CHECK_THROWS_AS(MotionScript::FromFile("/nonexistent.csv"), UserError);
}

}  // namespace
}  // namespace torquer::emulator
