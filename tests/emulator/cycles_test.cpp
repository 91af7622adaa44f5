// Repeated unplugging, bus resets, suspends and chip resets. The device must always come back, and
// the hand's motion in the meantime must be counted.
#include <array>
#include <cstdlib>
#include <random>

#include "tests/support/emulated_bench.h"
#include "tests/support/sanitizer.h"

namespace torquer::emulator {
namespace {

constexpr double kStrokeS = 0.04;
constexpr double kSpeedMmS = 300;
constexpr double kStillS = 0.02;

// Hand that moves on request and otherwise stands still.
class StrokingHand {
 public:
  explicit StrokingHand(Bench& bench) : bench_(bench) {
    bench.device.SetHand([this](double time_s) { return At(time_s); });
  }

  /// Moves to one side for a while, then stops; true if every count of it arrived.
  bool Stroke(double side) {
    Bench& bench = bench_;
    const std::int64_t sensed = bench.device.sensor().axial_counts();
    const std::int32_t counted = bench.last.axial_counts;
    const std::uint8_t boot = bench.last.boot_id;
    start_ = At(1e-6 * bench.device.now_us());
    start_s_ = 1e-6 * bench.device.now_us();
    speed_mm_s_ = side * kSpeedMmS;
    bench.gaps = 0;
    bench.Run(kStrokeS + kStillS);
    const std::int64_t moved = bench.device.sensor().axial_counts() - sensed;
    // 300 mm/s at 1200 counts per inch, for 40 ms.
    CHECK(std::abs(moved) > 500);
    CHECK(bench.gaps == 0);
    return bench.last.axial_counts - counted == moved && bench.last.boot_id == boot;
  }

 private:
  HandState At(double time_s) const {
    HandState hand = start_;
    hand.insertion_mm += speed_mm_s_ * std::clamp(time_s - start_s_, 0.0, kStrokeS);
    return hand;
  }

  Bench& bench_;
  HandState start_;
  double start_s_ = 0;
  double speed_mm_s_ = 0;
};

// Runs until reports arrive again and the sensor answers.
void ComeBack(Bench& bench) {
  for (int frame = 0; frame < 3000; ++frame) {
    bench.host.RunFrame();
    if (bench.host.ready() && !bench.host.suspended() && frame > 30 &&
        !(bench.last.flags & protocol::kFlagSensorFault)) {
      return;
    }
  }
  FAIL("it does not come back");
}

void Disturb(Bench& bench, int kind, std::mt19937& random) {
  std::uniform_real_distribution<double> share(0, 1);
  // Begins at any phase of a frame and lasts any time.
  bench.device.RunUntil(bench.device.now_us() + 1000 * share(random));
  const double pause_s = 0.03 * share(random);
  switch (kind) {
    case 0:
      bench.device.PowerOff();
      bench.Run(pause_s);
      bench.device.PowerOn();
      return bench.Start();
    case 1:
      bench.host.ResetPort();
      return ComeBack(bench);
    case 2:
      bench.host.Suspend();
      bench.Run(pause_s);
      bench.host.Resume();
      return ComeBack(bench);
    default:
      bench.device.ResetByPin();
      bench.Run(0.01);  // for the host to notice
      return bench.Start();
  }
}

void RunCycles(int cycles, unsigned seed) {
  INFO("seed " << seed);
  std::mt19937 random(seed);
  Bench bench;
  StrokingHand hand(bench);
  bench.Start();
  int lost = 0;
  for (int cycle = 0; cycle < cycles; ++cycle) {
    const int kind = static_cast<int>(random() % 4);
    INFO("cycle " << cycle << " of kind " << kind);
    Disturb(bench, kind, random);
    lost += hand.Stroke(cycle % 2 == 0 ? 1 : -1) ? 0 : 1;
    REQUIRE(lost == 0);
  }
  bench.CheckRules();
}

}  // namespace

TEST_CASE("unplugged, reset and suspended at random it comes back, and no count is lost") {
  RunCycles(test::Rounds(200, 10), 20261123);
}

TEST_CASE("the same a hundred thousand times, by hand: emulator_test \"[.soak]\"", "[.soak]") {
  RunCycles(100'000, 1);
}

}  // namespace torquer::emulator
