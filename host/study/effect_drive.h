// The hand with which the price of effects is measured.
#pragma once

#include <algorithm>

#include "host/simulator/simulation.h"

namespace torquer::study {

/// Feeds a wire of some 250 mm by 0.02 to 0.1 mm a tick, pedal and contrast button held, a tick a
/// millisecond.
class EffectDrive {
 public:
  explicit EffectDrive(scene::Scene& scene) : scene_(scene), session_(scene) {
    command_.controls = {.xray = true, .contrast = true};
    command_.target = session_.target();
  }

  /// Fast, to where `ticks` feeds end at 250 mm.
  void Insert(int ticks) {
    while (command_.target[0].insertion_mm < kLengthMm - ticks * 0.17 / 3) {
      command_.target[0].insertion_mm += 0.5;
      Tick();
    }
  }
  /// One feed.
  TickReport Feed() {
    constexpr double kFeeds[] = {0.02, 0.05, 0.1};
    command_.target[0].insertion_mm += kFeeds[feeds_++ % 3];
    return Tick();
  }

 private:
  static constexpr double kLengthMm = 250;

  TickReport Tick() {
    CountedBudget budget(scene_.budget_units());
    return session_.Tick(command_, budget);
  }

  scene::Scene& scene_;
  simulator::Simulation session_;
  simulator::Command command_;
  int feeds_ = 0;
};

}  // namespace torquer::study
