#include "host/simulator/coarse_scene.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::simulator {

namespace {

// True if the effect changes the instruments before they are cut into segments.
bool ShapesWire(const std::string& effect) {
  const std::vector<effects::EffectKind>& kinds = effects::AllEffects();
  return std::any_of(kinds.begin(), kinds.end(), [&](const effects::EffectKind& kind) {
    return kind.name == effect && (kind.shape != nullptr || kind.room != nullptr);
  });
}

bool ActsOnWire(effects::Effect& effect) {
  return effect.energy_term() != nullptr || effect.wall_stiffness() != nullptr ||
         effect.motion() != nullptr || effect.timed() != nullptr || effect.limit() != nullptr;
}

// Names of the effects that only observe the wire.
std::vector<std::string> NamesOfObservers(const scene::Scene& scene) {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < scene.effects().size(); ++k) {
    const std::string& name = scene.names_of_effects()[k];
    if (!ShapesWire(name) && !ActsOnWire(*scene.effects()[k])) names.push_back(name);
  }
  return names;
}

}  // namespace

std::unique_ptr<scene::Scene> MakeCoarseScene(const scene::Scene& scene) {
  scene::SceneSpec spec = scene.spec();
  spec.relaxation.segment_mm *= effects::Comparison::kSegmentFactor;
  const std::vector<std::string> observers = NamesOfObservers(scene);
  std::erase_if(spec.effects, [&](const scene::EffectSpec& effect) {
    return std::find(observers.begin(), observers.end(), effect.name) != observers.end();
  });
  return std::make_unique<scene::Scene>(std::move(spec), scene);
}

}  // namespace torquer::simulator
