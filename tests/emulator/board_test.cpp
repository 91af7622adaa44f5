// Board around the chip: state left by Arduino's bootloader, USB memory, contact bounce and the end
// switch. The joystick rests off center.
#include <algorithm>
#include <cmath>

#include "tests/support/emulated_bench.h"

namespace torquer::emulator {
namespace {

FirmwareImage WithCaterina(int clock_mhz) {
  const std::string suffix = clock_mhz == 16 ? "" : "-8mhz";
  return FirmwareImage::Load(
      torquer::test::FirmwarePath("torquer-firmware" + suffix + ".elf"),
      std::string(TORQUER_CATERINA_DIR "/caterina-start-") + std::to_string(clock_mhz) + "mhz.elf");
}

/// Runs until the firmware is on the bus again after a reset through the bootloader.
void Restart(Bench& bench) {
  bench.Run(0.08);  // the bootloader joins the bus and leaves it
  bench.Start();
}

TEST_CASE("started by Caterina, with the USB left on or not, the firmware comes up by the rules") {
  for (const int clock_mhz : {16, 8}) {
    Bench bench({}, WithCaterina(clock_mhz));
    bench.Start();
    bench.Run(0.2);
    CHECK(bench.Diagnostics().reset_reason == (protocol::kResetDerived | protocol::kResetPower));
    const std::uint8_t power_on = bench.last.boot_id;

    // The reset button starts a programming wait; without a programmer the sketch starts.
    bench.device.ResetByPin();
    Restart(bench);
    CHECK(bench.Diagnostics().reset_reason == 0);
    CHECK(bench.last.boot_id == power_on + 1);
    bench.Run(0.5);
    CHECK(bench.gaps == 0);
    CHECK(bench.host.toggle_errors() == 0);

    // Reset by command: the bootloader is skipped, or waits for its timeout.
    for (const protocol::Command command :
         {protocol::kCommandReset, protocol::kCommandEnterBootloader}) {
      const std::uint8_t before = bench.last.boot_id;
      REQUIRE(bench.Command(command) == TransferStatus::kDone);
      Restart(bench);
      CHECK(bench.Diagnostics().reset_reason ==
            (protocol::kResetDerived | protocol::kResetWatchdog));
      CHECK(bench.last.boot_id == before + 1);
    }

    const std::uint8_t before = bench.last.boot_id;
    bench.device.PowerOff();
    bench.Run(0.05);
    bench.device.PowerOn();
    bench.Start();
    CHECK(bench.Diagnostics().reset_reason == (protocol::kResetDerived | protocol::kResetPower));
    CHECK(bench.last.boot_id != before);

    bench.host.Suspend();
    bench.Run(0.1);
    CHECK(bench.device.PartsAwake().empty());
    bench.CheckRules();
  }
}

TEST_CASE("after Caterina, the LEDs that it drove are dark in suspend") {
  Bench bench({}, WithCaterina(16));
  bench.device.ResetByPin();
  Restart(bench);
  bench.host.Suspend();
  bench.Run(0.1);
  for (const std::string& part : bench.device.PartsAwake()) FAIL_CHECK(part);
  bench.CheckRules();
}

TEST_CASE("a controller that gives no memory is started again, and no report is believed sent") {
  Bench bench;
  bench.device.chip().SetDead(Atmega32u4::Peripheral::kUsbMemory);
  bench.Run(1);
  CHECK(bench.reports == 0);
  CHECK(bench.device.chip().resets() > 0);
}

TEST_CASE("a pedal that bounces for 20 ms is pressed once and released once") {
  for (std::uint32_t seed = 1; seed <= 10; ++seed) {
    BenchOptions options;
    options.seed = seed;
    options.contact_bounce_us = 20000;
    Bench bench(options);
    constexpr int kPresses = 10;
    bench.device.SetHand([](double time_s) {
      HandState hand;
      const double phase = std::fmod(time_s, 0.2);
      hand.buttons = time_s > 1 && time_s < 1 + 0.2 * kPresses && phase < 0.1
                         ? protocol::kButtonXray | protocol::kButtonClutch
                         : 0;
      return hand;
    });
    bench.Start();
    int changes = 0;
    std::uint8_t held = 0;
    while (bench.device.now_us() < 3.5e6) {
      bench.host.RunFrame();
      if ((bench.last.buttons ^ held) & protocol::kButtonXray) ++changes;
      held = bench.last.buttons;
    }
    CHECK(changes == 2 * kPresses);
    CHECK(held == 0);
  }
}

TEST_CASE("a pedal that is closed at rest is pressed while it is open") {
  BenchOptions options;
  options.closed_at_rest = protocol::kButtonXray;
  Bench bench(options);
  bool pressed = false;
  bench.device.SetHand([&pressed](double) {
    HandState hand;
    hand.buttons = pressed ? protocol::kButtonXray | protocol::kButtonClutch : 0;
    return hand;
  });
  bench.Start();
  bench.Run(0.1);
  CHECK(bench.last.buttons == protocol::kButtonXray);  // not set yet
  protocol::ConfigurationReport configuration = torquer::test::ConfigurationOf(1200, 20);
  configuration.closed_at_rest = protocol::kButtonXray;
  REQUIRE(bench.Set(configuration) == TransferStatus::kDone);
  bench.Run(0.3);
  CHECK(bench.last.buttons == 0);

  // Kept over a loss of power.
  bench.device.PowerOff();
  bench.Run(0.05);
  bench.device.PowerOn();
  bench.Start();
  for (const bool press : {true, false, true, false}) {
    pressed = press;
    bench.Run(0.1);
    CHECK(bench.last.buttons == (press ? protocol::kButtonXray | protocol::kButtonClutch : 0));
  }
  // The open contact wakes the host; the closed one, at rest, does not.
  REQUIRE(bench.host.Control({0x00, 3, 1, 0, 0}).status == TransferStatus::kDone);
  bench.host.Suspend();
  bench.Run(0.3);
  CHECK(bench.host.suspended());
  pressed = true;
  bench.Run(0.3);
  CHECK_FALSE(bench.host.suspended());
  bench.CheckRules();
}

TEST_CASE("the end switch marks the same place of the travel each time, for any count") {
  BenchOptions options;
  options.reference_switch_mm = 2.0;
  options.contact_bounce_us = 5000;
  Bench bench(options);
  // Moves out to 30 mm and home repeatedly, faster each time.
  bench.device.SetHand([](double time_s) {
    const double t = std::max(0.0, time_s - 1);
    HandState hand;
    hand.insertion_mm = 15 * (1 - std::cos(t * (1 + 0.2 * t)));
    return hand;
  });
  bench.Start();
  int closings = 0;
  bool at_reference = true;
  while (bench.device.now_us() < 14e6) {
    bench.host.RunFrame();
    const bool now = bench.last.flags & protocol::kFlagAtReference;
    if (now && !at_reference && (bench.last.flags & protocol::kFlagReference)) {
      ++closings;
      const double mark_mm = bench.last.reference_counts * 25.4 / 1200;
      // Distance that the hand covers in the few milliseconds before the contact conducts.
      CHECK(mark_mm <= 2.05);
      CHECK(mark_mm >= 1.7);
    }
    at_reference = now;
  }
  CHECK(closings >= 5);
  CHECK(bench.last.buttons == 0);

  Bench without;
  without.Start();
  without.Run(0.5);
  CHECK_FALSE(without.last.flags & (protocol::kFlagReference | protocol::kFlagAtReference));
  CHECK(without.last.reference_counts == 0);
}

TEST_CASE("lost motion is healed by the end switch") {
  BenchOptions options;
  options.reference_switch_mm = 1.0;
  Bench bench(options);
  // Home, out, and home again; on the way out the sensor is lifted for a while.
  bench.device.SetHand([](double time_s) {
    HandState hand;
    hand.insertion_mm = time_s < 2   ? 5 * std::abs(time_s - 1)
                        : time_s < 4 ? 5 + 20 * (time_s - 2)
                                     : std::max(0.0, 45 - 20 * (time_s - 4));
    return hand;
  });
  bench.Start();
  bench.Run(2.2 - bench.device.now_us() * 1e-6);
  REQUIRE((bench.last.flags & protocol::kFlagReference) != 0);
  const std::int32_t first = bench.last.reference_counts;
  bench.Run(0.5);
  bench.device.sensor().SetLifted(true);
  bench.Run(0.5);  // 10 mm
  bench.device.sensor().SetLifted(false);
  bench.Run(4);
  const double drift_mm = (bench.last.reference_counts - first) * 25.4 / 1200;
  CHECK(drift_mm == Approx(-10).margin(0.2));
}

TEST_CASE("a stick that rests beside its middle, as a KY-023 does, is silent at rest") {
  for (const double offset : {-0.2, -0.08, 0.05, 0.2}) {
    Bench bench;
    bench.device.SetHand([offset](double time_s) {
      HandState hand;
      hand.joystick_x = time_s < 1 ? offset : time_s < 2 ? 1 : time_s < 3 ? -1 : offset + 0.02;
      hand.joystick_y = -offset;
      return hand;
    });
    bench.Start();
    bench.Run(0.5);
    CHECK(bench.last.joystick_x == 512);
    CHECK(bench.last.joystick_y == 512);
    CHECK(bench.Diagnostics().joystick_rest_x == Approx(511.5 * (1 + offset)).margin(2));
    bench.Run(1);
    CHECK(bench.last.joystick_x >= 1021);
    bench.Run(1);
    CHECK(bench.last.joystick_x <= 2);
    bench.Run(1);
    CHECK(bench.last.joystick_x == 512);  // its return is inexact
  }
}

}  // namespace
}  // namespace torquer::emulator
