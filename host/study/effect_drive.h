// Effect drive: the hand motion for measuring the cost of effects.
#pragma once

#include <algorithm>

#include "host/simulator/simulation.h"

namespace torquer::study {

/// Length of the wire at the end of the feeds, mm. The quick value is for tests.
inline constexpr double kDrivenMm = 250;
inline constexpr double kDrivenQuickMm = 60;

/// Feeds a wire up to `length_mm` by 0.02 to 0.1 mm per tick of 1 ms. The X-ray pedal and the
/// contrast button are held down.
class EffectDrive {
 public:
  EffectDrive(scene::Scene& scene, double length_mm)
      : scene_(scene), session_(scene), length_mm_(length_mm) {
    command_.controls = {.xray = true, .contrast = true};
    command_.target = session_.target();
  }

  /// Inserts fast, up to the point from which `ticks` feeds reach `length_mm`.
  void Insert(int ticks) {
    while (command_.target[0].insertion_mm < length_mm_ - ticks * 0.17 / 3) {
      command_.target[0].insertion_mm += 0.5;
      Tick();
    }
  }
  /// Makes one feed in one tick.
  TickReport Feed() {
    constexpr double kFeeds[] = {0.02, 0.05, 0.1};
    command_.target[0].insertion_mm += kFeeds[feeds_++ % 3];
    return Tick();
  }

 private:
  TickReport Tick() {
    CountedBudget budget(scene_.budget_units());
    return session_.Tick(command_, budget);
  }

  scene::Scene& scene_;
  simulator::Simulation session_;
  simulator::Command command_;
  double length_mm_;
  int feeds_ = 0;
};

}  // namespace torquer::study
