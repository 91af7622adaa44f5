// Describes the simulation of a scene in words.
#pragma once

#include <string>

#include "host/simulator/scene/scene.h"

namespace torquer::simulator {

/// Text: vessel, instruments, method and effects of a scene, the unused effects, and a tick's time.
/// The call runs ticks to measure the time.
std::string Explain(scene::Scene& scene);

}  // namespace torquer::simulator
