// Publishes the readings of a scene's observers while it runs live.
#pragma once

#include <cstdint>

#include "host/bus/bus.h"
#include "host/simulator/exchangeable_simulation.h"

namespace torquer::simulator {

/// Interval between two messages, us.
inline constexpr std::int64_t kReadingsEveryUs = 100'000;

/// Publishes Simulation::Readings(), if the scene has observers.
class LiveReadings {
 public:
  /// Both arguments must outlive this.
  LiveReadings(const ExchangeableSimulation& simulation, bus::Bus& bus);

  /// Publishes if the last message is at least kReadingsEveryUs old. `now_us`: by
  /// bus::MonotonicUs().
  void PublishWhenDue(std::int64_t now_us);
  /// Publishes now.
  void Publish();

 private:
  const ExchangeableSimulation& simulation_;
  bus::Bus& bus_;
  const bool any_;
  std::int64_t published_us_ = 0;
};

}  // namespace torquer::simulator
