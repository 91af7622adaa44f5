// Coarse scene: the second run of a scene that compares its segments.
#pragma once

#include <memory>
#include <string>

#include "host/simulator/scene/scene.h"

namespace torquer::simulator {

/// The scene with segments effects::Comparison::kSegmentFactor times as long, and with the effects
/// that act on the wire alone. It shares the vessel. Throws UserError for the key of `effect`,
/// which compares, if the scene cannot have such segments.
std::unique_ptr<scene::Scene> MakeCoarseScene(const scene::Scene& scene, const std::string& effect);

}  // namespace torquer::simulator
