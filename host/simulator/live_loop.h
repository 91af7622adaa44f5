// The real-time loop: commands in, wire states out.
#pragma once

#include <atomic>
#include <cstdint>

#include "host/bus/bus.h"
#include "host/simulator/simulation.h"
#include "host/support/time_histogram.h"

namespace torquer::simulator {

/// What a run of the loop did.
struct LiveStatistics {
  std::int64_t ticks = 0;
  std::int64_t commands = 0;
  std::int64_t unconverged = 0;
  TimeHistogram command_to_state;  ///< from a command's publishing to its state's
  TimeHistogram solve;
};

/// Runs until `stop`: a tick for every command (the newest of each instrument counts), and while
/// the wire is not at rest one every millisecond. Publishes every state, at rest the last one again
/// five times a second, the scene once a second, and health.
LiveStatistics RunLive(Simulation& simulation, bus::Bus& bus, const std::atomic<bool>& stop);

}  // namespace torquer::simulator
