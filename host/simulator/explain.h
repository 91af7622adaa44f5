// What a scene simulates, in words.
#pragma once

#include <string>

#include "host/simulator/scene/scene.h"

namespace torquer::simulator {

/// Vessel, wire, method and effects of a scene, what is off, and what a tick costs, measured on the
/// spot.
std::string Explain(scene::Scene& scene);

}  // namespace torquer::simulator
