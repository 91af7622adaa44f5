// TORQUER_WIRE_FORCES: what a scene with [effects.internal_forces] finds along the wire.
#pragma once

#include <torquer_lcm/wire_forces_t.hpp>

#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// Most nodes of one message; longer wires are sent with a stride.
inline constexpr int kMostNodesInForces = 1000;

/// The forces of the present state, all but the time of sending. Only where simulation.forces() is
/// not null.
void DescribeForces(const Simulation& simulation, torquer_lcm::wire_forces_t& out);

}  // namespace torquer::simulator
