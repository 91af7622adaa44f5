// USB suspend: the device draws almost no current, and resumes in its former state.
#include <sstream>

#include "tests/support/emulated_bench.h"

namespace torquer::emulator {
namespace {

constexpr std::uint16_t kRemoteWakeup = 1;

HandState Steady(double time_s) {
  HandState hand;
  hand.insertion_mm = 20 * time_s;
  return hand;
}

std::string PartsAwake(Bench& bench) {
  std::ostringstream names;
  for (const std::string& part : bench.device.PartsAwake()) names << part << ", ";
  return names.str();
}

TEST_CASE("a suspended device sleeps within 10 ms, and keeps its count") {
  for (const FirmwareImage& image : {Image16(), Image8()}) {
    Bench bench({}, image);
    bench.device.SetHand(Steady);
    bench.Start();
    bench.Run(0.5);
    const protocol::InputReport before = bench.last;
    CHECK_FALSE(PartsAwake(bench).empty());

    bench.host.Suspend();
    bench.Run(0.010);
    CHECK(PartsAwake(bench) == "");
    // Except for the watchdog's ticks it stays asleep, far beyond the watchdog's timeout.
    int awake = 0;
    for (int i = 0; i < 2000; ++i) {
      bench.host.RunFrame();
      awake += !PartsAwake(bench).empty();
    }
    CHECK(awake < 70);
    CHECK(bench.device.chip().resets() == 0);

    bench.host.Resume();
    bench.Run(0.035);
    CHECK_FALSE(bench.host.suspended());
    CHECK(bench.host.ready());
    CHECK((bench.last.flags & protocol::kFlagSensorFault) != 0);  // it is still waking
    bench.Run(0.2);
    CHECK_FALSE(bench.last.flags & protocol::kFlagSensorFault);
    CHECK(bench.last.boot_id == before.boot_id);
    CHECK(bench.last.cpi == before.cpi);
    // The hand's motion during suspend, 40 mm, is lost; the sensor fault flag reports that.
    CHECK(bench.last.axial_counts >= before.axial_counts);
    CHECK(bench.last.axial_counts < before.axial_counts + 300);
    // The watchdog's oscillator measured the time, minus the tick that the host interrupted.
    const double slept_s = 1e-6 * (bench.last.device_time_us - before.device_time_us);
    CHECK(slept_s == Approx(2.25).margin(0.06));
    CHECK(bench.Diagnostics().sensor_faults == 0);
    CHECK(bench.Diagnostics().reset_reason == 1);
    const std::int32_t awake_again = bench.last.axial_counts;
    bench.gaps = 0;
    bench.Run(1);
    CHECK(bench.last.axial_counts == Approx(awake_again + 945).margin(4));
    CHECK(bench.gaps == 0);
    CHECK(bench.host.toggle_errors() == 0);
    bench.CheckRules();
  }
}

TEST_CASE("suspended fifty times at every phase of a frame, it always comes back") {
  Bench bench;
  bench.Start();
  for (int round = 0; round < 50; ++round) {
    bench.device.RunUntil(bench.device.now_us() + 20 * round);
    bench.host.Suspend();
    bench.Run(0.001 * (1 + round));  // some end before the device notices
    bench.host.Resume();
    bench.Run(0.031);
    REQUIRE_FALSE(bench.host.suspended());
    const int reports = bench.reports;
    bench.Run(0.01);
    REQUIRE(bench.reports >= reports + 9);
  }
  CHECK(bench.Diagnostics().reset_reason == 1);
  bench.Run(0.2);
  CHECK_FALSE(bench.last.flags & protocol::kFlagSensorFault);
  bench.CheckRules();
}

TEST_CASE("a pedal wakes the host if that has allowed it, and only then") {
  for (const FirmwareImage& image : {Image16(), Image8()}) {
    for (const bool allowed : {true, false}) {
      Bench bench({}, image);
      bool pressed = false;
      bench.device.SetHand([&pressed](double) {
        HandState hand;
        hand.buttons = pressed ? protocol::kButtonXray : 0;
        return hand;
      });
      bench.Start();
      const std::uint8_t request = allowed ? 3 : 1;  // SET_FEATURE or CLEAR_FEATURE
      REQUIRE(bench.host.Control({0x00, request, kRemoteWakeup, 0, 0}).status ==
              TransferStatus::kDone);
      const ControlResult status = bench.host.Control({0x80, 0, 0, 0, 2});
      REQUIRE(status.data == std::vector<std::uint8_t>{std::uint8_t(allowed ? 2 : 0), 0});
      bench.host.Suspend();
      bench.Run(0.5);
      REQUIRE(bench.host.suspended());
      pressed = true;
      bench.Run(0.5);
      CHECK(bench.host.suspended() == !allowed);
      if (allowed) {
        CHECK(bench.last.buttons == protocol::kButtonXray);
        const int reports = bench.reports;
        bench.Run(0.1);
        CHECK(bench.reports == reports + 100);
      }
      bench.CheckRules();
    }
  }
}

TEST_CASE("a bus reset wakes a suspended device, and takes the leave to wake the host back") {
  Bench bench;
  bench.Start();
  REQUIRE(bench.host.Control({0x00, 3, kRemoteWakeup, 0, 0}).status == TransferStatus::kDone);
  bench.host.Suspend();
  bench.Run(0.2);
  REQUIRE(PartsAwake(bench) == "");
  bench.host.ResetPort();
  REQUIRE(bench.host.RunUntilReady());
  CHECK(bench.host.Control({0x80, 0, 0, 0, 2}).data == std::vector<std::uint8_t>{0, 0});
  bench.Run(0.3);
  CHECK_FALSE(bench.last.flags & protocol::kFlagSensorFault);
  bench.CheckRules();
}

TEST_CASE("a disturbance of a suspended bus is slept off, and the host can still be woken") {
  Bench bench;
  bool pressed = false;
  bench.device.SetHand([&pressed](double) {
    HandState hand;
    hand.buttons = pressed ? protocol::kButtonClutch : 0;
    return hand;
  });
  bench.Start();
  REQUIRE(bench.host.Control({0x00, 3, kRemoteWakeup, 0, 0}).status == TransferStatus::kDone);
  bench.host.Suspend();
  bench.Run(0.2);
  bench.device.usb().Activity();  // Spurious wake-up: no start-of-frame follows.
  bench.device.chip().UpdateUsbInterrupts();
  bench.Run(0.01);
  CHECK_FALSE(PartsAwake(bench).empty());
  bench.Run(0.3);
  CHECK(PartsAwake(bench) == "");
  pressed = true;
  bench.Run(0.5);
  CHECK_FALSE(bench.host.suspended());
  bench.CheckRules();
}

TEST_CASE("a firmware that hangs while it is suspended is reset by the watchdog") {
  Bench bench;
  bench.Start();
  bench.host.Suspend();
  bench.Run(0.2);
  bench.device.chip().SetDead(Atmega32u4::Peripheral::kPll);  // on resume it waits for the clock
  bench.host.Resume();
  bench.Run(0.1);
  bench.device.chip().SetDead(Atmega32u4::Peripheral::kNone);
  bench.Run(0.2);
  CHECK(bench.device.chip().resets() > 0);
  bench.Start();
  CHECK(bench.Diagnostics().reset_reason == 8);
}

}  // namespace
}  // namespace torquer::emulator
