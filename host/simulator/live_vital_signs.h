// Publishes the curves of the patient monitor while a scene runs live.
#pragma once

#include <cstdint>
#include <torquer_lcm/vital_signs_t.hpp>

#include "host/bus/bus.h"
#include "host/simulator/exchangeable_simulation.h"

namespace torquer::simulator {

/// Interval between two messages, us.
inline constexpr std::int64_t kVitalSignsEveryUs = 100'000;

/// Fills `out` with the present vital signs, except publish_us. Requires that simulation.vitals()
/// is not null.
void DescribeVitalSigns(const Simulation& simulation, torquer_lcm::vital_signs_t& out);

/// Publishes Simulation::vitals(), if the scene has a patient monitor.
class LiveVitalSigns {
 public:
  /// Both arguments must outlive this.
  LiveVitalSigns(const ExchangeableSimulation& simulation, bus::Bus& bus)
      : simulation_(simulation), bus_(bus) {}

  /// Publishes if the last message is at least kVitalSignsEveryUs old. `now_us`: by
  /// bus::MonotonicUs().
  void PublishWhenDue(std::int64_t now_us);

 private:
  const ExchangeableSimulation& simulation_;
  bus::Bus& bus_;
  torquer_lcm::vital_signs_t message_{};
};

}  // namespace torquer::simulator
