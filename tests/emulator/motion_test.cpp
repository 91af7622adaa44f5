// Motion from the hand to the counts in the reports: no loss, correct signs, doubts flagged.
#include <cmath>
#include <numbers>

#include "tests/support/emulated_bench.h"

namespace torquer::emulator {
namespace {

constexpr double kMmPerInch = 25.4;
constexpr int kCpi = 1200;

/// Rests for `rest_s`, then moves back and forth at 1 m/s, turning at 5 rad/s.
HandState Meter(double time_s, double rest_s) {
  HandState hand;
  const double moving_s = std::max(0.0, time_s - rest_s);
  hand.insertion_mm = 1000 * moving_s;
  hand.rotation_rad = -5 * moving_s;
  return hand;
}

void RunAtAMeterASecond(const FirmwareImage& image, int seconds) {
  BenchOptions options;
  options.start_time_us = 0xffffffffu - 2000000u;  // device time wraps after 2 s
  Bench bench(options, image);
  bench.device.SetHand(
      [seconds](double time_s) { return Meter(std::min(time_s, seconds + 0.5), 0.5); });
  bench.Start();
  std::uint32_t time_us = bench.last.device_time_us;
  bool wrapped = false;
  const double end_s = seconds + 1.0;
  while (bench.device.now_us() < end_s * 1e6) {
    const int before = bench.reports;
    bench.host.RunFrame();
    REQUIRE(bench.reports == before + 1);
    const std::uint32_t step_us = bench.last.device_time_us - time_us;
    REQUIRE(step_us >= 900);
    REQUIRE(step_us <= 1100);
    wrapped = wrapped || bench.last.device_time_us < time_us;
    time_us = bench.last.device_time_us;
  }
  CHECK(wrapped);
  CHECK(bench.gaps == 0);
  CHECK(bench.host.toggle_errors() == 0);
  // The reports contain all of the sensor's counts, and these match the hand's motion exactly.
  CHECK(bench.last.axial_counts == bench.device.sensor().axial_counts());
  CHECK(bench.last.transverse_counts == bench.device.sensor().transverse_counts());
  CHECK(bench.last.axial_counts == std::lround(seconds * 1000 / kMmPerInch * kCpi));
  CHECK(bench.last.transverse_counts == std::lround(-5.0 * seconds * 5.0 / kMmPerInch * kCpi));
  const protocol::DiagnosticsReport diagnostics = bench.Diagnostics();
  CHECK(diagnostics.frames_missed == 0);
  CHECK(diagnostics.sensor_faults == 0);
  CHECK(bench.device.CyclesUsedFraction() < 0.6);
  bench.CheckRules();
}

TEST_CASE("a minute at 1 m/s over the wrap of the device time: no report and no count lost") {
  RunAtAMeterASecond(Image16(), 60);
}

TEST_CASE("the same at 8 MHz, for ten seconds") { RunAtAMeterASecond(Image8(), 10); }

// The start of a frame and the overflow of the chip's timer coincide at every phase.
TEST_CASE("device time steps evenly, whenever the frames begin") {
  for (double phase_us = 0; phase_us < 8; phase_us += 0.5) {
    Bench bench;
    bench.device.RunUntil(phase_us);
    bench.Start();
    std::uint32_t time_us = bench.last.device_time_us;
    for (int frame = 0; frame < 4200; ++frame) {
      bench.host.RunFrame();
      REQUIRE(bench.last.device_time_us - time_us >= 950);
      REQUIRE(bench.last.device_time_us - time_us <= 1050);
      time_us = bench.last.device_time_us;
    }
  }
}

// The firmware reads the sensor once per frame, at a fixed time after the frame's start.
TEST_CASE("sampling is locked to the start of the frame, at both clocks") {
  for (const FirmwareImage& image : {Image16(), Image8()}) {
    for (const double phase_us : {0.0, 3.3, 411.7}) {
      std::vector<double> reads_us;
      Bench bench({}, image);
      bench.device.SetHand([&reads_us](double time_s) {
        reads_us.push_back(time_s * 1e6);
        return HandState{};
      });
      bench.device.RunUntil(phase_us);
      bench.Start();
      double first_us = 1e9, last_us = 0;
      for (int frame = 0; frame < 2000; ++frame) {
        reads_us.clear();
        const double start_us = bench.device.now_us();
        bench.host.RunFrame();
        int reads = 0;
        for (const double read_us : reads_us) {
          // Skips the emulator's own reads, which are for joystick and buttons.
          const double after_us = read_us - start_us;
          if (after_us < 1e-3 || std::fmod(read_us + 1e-3, 1000) < 2e-3) continue;
          ++reads;
          first_us = std::min(first_us, after_us);
          last_us = std::max(last_us, after_us);
        }
        REQUIRE(reads == 1);
      }
      CHECK(first_us > 10);
      CHECK(last_us < 200);
      CHECK(last_us - first_us < 40);
      bench.CheckRules();
    }
  }
}

TEST_CASE("insertion counts up, retraction down, right-handed rotation up") {
  Bench bench;
  bench.device.SetHand([](double time_s) {
    HandState hand;
    hand.insertion_mm = time_s < 1 ? 0 : time_s < 2 ? 10 : 4;
    hand.rotation_rad = time_s < 3 ? 0 : time_s < 4 ? 1 : -2;
    return hand;
  });
  bench.Start();
  bench.Run(1);
  CHECK(bench.last.axial_counts == 472);  // 10 mm
  CHECK(bench.last.transverse_counts == 0);
  bench.Run(1);
  CHECK(bench.last.axial_counts == 189);  // 4 mm
  bench.Run(1);
  CHECK(bench.last.transverse_counts == 236);  // 1 rad on 5 mm
  bench.Run(1);
  CHECK(bench.last.transverse_counts == -472);
}

TEST_CASE("the cylinder's radius makes the transverse counts") {
  BenchOptions options;
  options.cylinder_radius_mm = 10;
  Bench bench(options);
  bench.device.SetHand([](double time_s) {
    HandState hand;
    hand.rotation_rad = time_s < 1 ? 0 : 1;
    return hand;
  });
  bench.Start();
  bench.Run(1);
  CHECK(bench.last.transverse_counts == 472);
}

TEST_CASE("a misaligned, wrongly scaled sensor mixes the axes as set") {
  BenchOptions options;
  options.sensor.misalignment_rad = 3 * std::numbers::pi / 180;
  options.sensor.scale = 1.02;
  Bench bench(options);
  bench.device.SetHand([](double time_s) {
    HandState hand;
    hand.insertion_mm = time_s < 1 ? 0 : 100;
    return hand;
  });
  bench.Start();
  bench.Run(1);
  const double counts = 100 / kMmPerInch * kCpi * 1.02;
  CHECK(bench.last.axial_counts ==
        Approx(counts * std::cos(options.sensor.misalignment_rad)).margin(1));
  CHECK(bench.last.transverse_counts ==
        Approx(-counts * std::sin(options.sensor.misalignment_rad)).margin(1));
}

TEST_CASE("noise makes runs of different seeds differ, and of equal seeds agree") {
  const auto run = [](std::uint32_t seed) {
    BenchOptions options;
    options.seed = seed;
    options.sensor.noise_counts = 0.5;
    Bench bench(options);
    bench.device.SetHand([](double time_s) { return Meter(time_s, 0.2); });
    bench.Start();
    bench.Run(1);
    return std::vector<std::int64_t>{bench.last.axial_counts, bench.last.transverse_counts,
                                     bench.last.device_time_us};
  };
  const auto first = run(5);
  CHECK(run(5) == first);
  CHECK(run(6) != first);
  CHECK(first[0] == Approx(std::lround(0.97 * 1000 / kMmPerInch * kCpi)).epsilon(0.05));
}

TEST_CASE("a lifted sensor reports it and does not count; after landing it counts again") {
  Bench bench;
  bench.device.SetHand([](double time_s) {
    HandState hand;
    hand.insertion_mm = 10 * time_s;
    return hand;
  });
  bench.Start();
  bench.Run(0.5);
  CHECK_FALSE(bench.last.flags & protocol::kFlagLift);
  bench.device.sensor().SetLifted(true);
  bench.Run(0.01);
  const std::int32_t held = bench.last.axial_counts;
  bench.Run(1);
  CHECK((bench.last.flags & protocol::kFlagLift) != 0);
  CHECK(bench.last.axial_counts == held);
  CHECK(bench.last.surface_quality < 10);
  bench.device.sensor().SetLifted(false);
  bench.Run(1);
  CHECK_FALSE(bench.last.flags & protocol::kFlagLift);
  CHECK(bench.last.axial_counts == Approx(held + 10 / kMmPerInch * kCpi).margin(2));
  CHECK(bench.last.surface_quality > 30);
}

TEST_CASE("joystick and buttons arrive") {
  Bench bench;
  bench.device.SetHand([](double time_s) {
    HandState hand;
    hand.joystick_x = 1;
    hand.joystick_y = -0.5;
    hand.buttons = time_s < 1 ? 0 : protocol::kButtonXray | protocol::kButtonClutch;
    return hand;
  });
  bench.Start();
  CHECK(bench.last.buttons == 0);
  CHECK(bench.last.joystick_x >= 1022);
  CHECK(bench.last.joystick_y == Approx(256).margin(2));
  bench.Run(1);
  CHECK(bench.last.buttons == (protocol::kButtonXray | protocol::kButtonClutch));
}

TEST_CASE("each button arrives alone, beside a closed end switch too") {
  for (const bool is_home : {false, true}) {
    BenchOptions options;
    if (is_home) options.reference_switch_mm = 1;
    Bench bench(options);
    std::uint8_t held = 0;
    bench.device.SetHand([&held](double) {
      HandState hand;
      hand.buttons = held;
      return hand;
    });
    bench.Start();
    bench.Run(0.1);
    for (const protocol::Button button : {protocol::kButtonXray, protocol::kButtonContrast,
                                          protocol::kButtonClutch, protocol::kButtonStick}) {
      held = button;
      bench.Run(0.1);
      CHECK(bench.last.buttons == button);
      CHECK(((bench.last.flags & protocol::kFlagAtReference) != 0) == is_home);
    }
  }
}

}  // namespace
}  // namespace torquer::emulator
