// Message that describes a scene on the bus.
#pragma once

#include <torquer_lcm/scene_description_t.hpp>

#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// Describes the scene with its present devices. The hash is that of the scene at the start.
torquer_lcm::scene_description_t Describe(const Simulation& simulation);

}  // namespace torquer::simulator
