#include "host/viewer/playback.h"

#include <catch2/catch.hpp>
#include <vector>

using torquer::viewer::Playback;
using torquer::viewer::ReplayControls;

namespace {

const std::vector<std::int64_t> kTimesUs = {1000, 2000, 2000, 4000, 7000};
constexpr std::int64_t kLengthUs = 9000;

ReplayControls Asked(bool play, double speed = 1) {
  ReplayControls controls;
  controls.play = play;
  controls.speed = speed;
  return controls;
}

ReplayControls Stepped(int steps) {
  ReplayControls controls = Asked(false);
  controls.steps = steps;
  return controls;
}

}  // namespace

TEST_CASE("A replay has the chosen speed, and loses no part of a microsecond") {
  Playback playback(kLengthUs, kTimesUs);
  CHECK(playback.at_us() == 1000);
  CHECK(playback.playing());
  playback.Advance(500000);  // the first call: no time has passed
  CHECK(playback.at_us() == 1000);
  playback.Advance(500300);
  CHECK(playback.at_us() == 1300);
  playback.Take(Asked(true, 0.1));
  for (int k = 1; k <= 100; ++k) playback.Advance(500300 + 15 * k);
  CHECK(playback.at_us() == Approx(1300 + 150).margin(1));
  playback.Take(Asked(false, 0.1));
  playback.Advance(700000);
  CHECK(playback.at_us() == Approx(1450).margin(1));
  playback.Take(Asked(true, 10));
  playback.Advance(700100);
  CHECK(playback.at_us() == Approx(2450).margin(1));
}

TEST_CASE("A replay stops at the end, and begins again from there") {
  Playback playback(kLengthUs, kTimesUs);
  playback.Advance(0);
  playback.Advance(1000000);
  CHECK(playback.at_us() == kLengthUs);
  CHECK_FALSE(playback.playing());
  playback.Take(Asked(true));
  CHECK(playback.at_us() == 1000);
  playback.Advance(1000100);
  CHECK(playback.at_us() == 1100);
}

TEST_CASE("A replay jumps to a time, and not beyond the end") {
  Playback playback(kLengthUs, kTimesUs);
  ReplayControls controls = Asked(false);
  controls.at_s = 0.005;
  playback.Take(controls);
  CHECK(playback.at_us() == 5000);
  controls.at_s = 1e300;
  playback.Take(controls);
  CHECK(playback.at_us() == kLengthUs);
  // The user moved to the end, so playing does not restart.
  controls.play = true;
  playback.Take(controls);
  CHECK(playback.at_us() == kLengthUs);
}

TEST_CASE("Steps go from state to state, and stop at the first and the last") {
  Playback playback(kLengthUs, kTimesUs);
  playback.Take(Stepped(1));
  CHECK(playback.at_us() == 2000);
  playback.Take(Stepped(1));
  CHECK(playback.at_us() == 4000);
  playback.Take(Stepped(-1));
  CHECK(playback.at_us() == 2000);
  playback.Take(Stepped(-1));
  CHECK(playback.at_us() == 1000);
  playback.Take(Stepped(-1));
  CHECK(playback.at_us() == 1000);
  playback.Take(Stepped(3));
  CHECK(playback.at_us() == 7000);
  playback.Take(Stepped(1000));
  CHECK(playback.at_us() == 7000);
  // Between two states, a step back goes to the state before the displayed one.
  ReplayControls controls = Stepped(-1);
  controls.at_s = 0.005;
  playback.Take(controls);
  CHECK(playback.at_us() == 2000);
  controls.steps = 1;
  playback.Take(controls);
  CHECK(playback.at_us() == 7000);
}
