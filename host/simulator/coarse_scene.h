// Coarse scene: the second run of a scene that compares its segments.
#pragma once

#include <memory>

#include "host/simulator/scene/scene.h"

namespace torquer::simulator {

/// The scene with segments effects::Comparison::kSegmentFactor times as long, and with the effects
/// that act on the wire alone. It shares the vessel.
std::unique_ptr<scene::Scene> MakeCoarseScene(const scene::Scene& scene);

}  // namespace torquer::simulator
