// Channel TORQUER_WIRE_FORCES: forces along the wire in a scene with [effects.internal_forces].
#pragma once

#include <torquer_lcm/wire_forces_t.hpp>

#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// Maximum number of nodes in one message; longer wires are sent with a stride.
inline constexpr int kMostNodesInForces = 1000;

/// Fills `out` with the forces of the present state, except publish_us. Requires that
/// simulation.forces() is not null.
void DescribeForces(const Simulation& simulation, torquer_lcm::wire_forces_t& out);

}  // namespace torquer::simulator
