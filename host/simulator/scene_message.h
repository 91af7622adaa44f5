// Message that describes a scene on the bus.
#pragma once

#include <torquer_lcm/scene_description_t.hpp>

#include "host/simulator/scene/scene.h"

namespace torquer::simulator {

torquer_lcm::scene_description_t Describe(const scene::Scene& scene);

}  // namespace torquer::simulator
