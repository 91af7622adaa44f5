// The real-time loop: commands in, wire states out.
#pragma once

#include <atomic>
#include <cstdint>

#include "host/bus/bus.h"
#include "host/simulator/exchangeable_simulation.h"
#include "host/support/time_histogram.h"

namespace torquer::simulator {

/// Statistics of a run.
struct LiveStatistics {
  std::int64_t ticks = 0;
  std::int64_t commands = 0;
  std::int64_t unconverged = 0;
  TimeHistogram command_to_state;  ///< from a command's publication to its state's
  TimeHistogram solve;
};

/// Runs until `stop`. Each command makes a tick; the newest command of each instrument is valid.
/// While the wire is not at rest or the scene evolves, there is a tick every millisecond. Publishes
/// every state, and repeats the last one five times a second at rest. Also publishes the scene once
/// a second, the instruments' devices, and health. Executes orders to exchange instruments.
LiveStatistics RunLive(ExchangeableSimulation& simulation, bus::Bus& bus,
                       const std::atomic<bool>& stop);

}  // namespace torquer::simulator
